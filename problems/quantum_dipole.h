// A quantum particle in a box. A dipole field must transfer it from the ground
// state to a superposition of the second and the third eigenstate.
//
//   i d psi/dt = (-d_xx + u(t) x) psi,   x in [0, 2],   psi(0) = es(1)
//   y = psi(T),   L = 1 - |<y*|y>|^2,   y* = cos(a) es(2) + sin(a) es(3)
//
// The network maps the target y* to the field of all time steps.
// The simulator and its discretization: schroedinger.h.
//
// Shapes:  state, network input, y: 28 (14 points: real part, imaginary part);
//          x: Nt = num_steps.
// Units:   hbar = 2 m = 1; <a|b> = sum_k conj(a_k) b_k, and all states have
//          norm one. So 0 <= L <= 1, and a phase of y is free.
// Data:    np.random.seed(data_seed); for each target normal() twice, for
//          cos(a) and sin(a) up to their norm, and uniform(0, 2 pi) twice, for
//          two unused phases of the release. The first half is for training.
//          The release rounds the states to single precision.
// Settings: Nt 384, dt 0.05, network 28-20-20-20-384 tanh (9,484 weights), N
//          1024 + 1024, B 16, data_seed 1; half-inverse: step size 0.5,
//          truncation 1e-5.
// Facts:   the loss is no sum of squares, so Ceres' trust-region solvers do not
//          apply. Its gradient in y vanishes where <y*|y> = 0, so u = 0, which leaves
//          y in the ground state, is a stationary point, at L = 1. As the norm
//          is conserved, y^T J = 0 for every sample, and a batch has B singular
//          values that are zero.
// Source:  Schnell, Holl, Thuerey, ICLR 2022, section 3.4, arXiv 2203.10131,
//          and its code, Quantum_dipole/.
#ifndef PROBLEMS_QUANTUM_DIPOLE_H_
#define PROBLEMS_QUANTUM_DIPOLE_H_

#include <cmath>
#include <cstdint>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "fmt/core.h"
#include "invgrad/autodiff_loss.h"
#include "invgrad/compare/sample_data.h"
#include "invgrad/random.h"
#include "problems/schroedinger.h"

namespace invgrad {

// L = 1 - |<y*|y>|^2, the infidelity of two states of norm one.
struct Infidelity {
  template <typename T>
  bool operator()(const T* y, const double* target, T* loss) const {
    T re(0.0), im(0.0);
    for (int k = 0; k < SchroedingerSimulator::kStateSize; k += 2) {
      re += target[k] * y[k] + target[k + 1] * y[k + 1];
      im += target[k] * y[k + 1] - target[k + 1] * y[k];
    }
    *loss = 1.0 - (re * re + im * im);
    return true;
  }
};

// The norm of a state is its invariant.
class InfidelityLoss final
    : public AutoDiffLoss<Infidelity, SchroedingerSimulator::kStateSize> {
 public:
  bool has_invariant() const override { return true; }
};

// `data`: targets of norm one, one a row.
struct QuantumDipole {
  int num_steps = 384;
  double dt = 0.05;
  int num_samples = 1024;
  int data_seed = 1;
  void Describe(OptionSet* set) {
    set->Add("num_steps", &num_steps, {1, 1e5}, "time steps, Nt");
    set->Add("dt", &dt, {1e-9, 10.0}, "length of a time step");
    DescribeSamples(1, 1e7, &num_samples, &data_seed, set);
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    const auto generate = [this](int num_rows) {
      return DrawTargets(num_rows, data_seed);
    };
    const SampleSize sample_size = {num_samples, kStateSize, 3.0 * kStateSize};
    if (!MakeData(sample_size, generate, problem, error) ||
        !AreTargets(problem->data, error)) {
      return false;
    }
    DataSet all;
    all.inputs = problem->data.transpose();
    all.targets = all.inputs;
    all.contexts =
        SchroedingerSimulator::Eigenstate(1).replicate(1, all.num_samples());
    SplitSamples(all, 16, problem);
    problem->num_epochs = 25;
    problem->model = std::make_shared<Model>(
        DenseNetwork({kStateSize, 20, 20, 20, num_steps}, Activation::kTanh),
        std::make_shared<SchroedingerSimulator>(num_steps, dt),
        std::make_shared<InfidelityLoss>(),
        Reduction::kMean);
    return true;
  }

 private:
  static constexpr int kStateSize = SchroedingerSimulator::kStateSize;

  static Eigen::MatrixXd DrawTargets(int num_targets, int seed) {
    const Eigen::VectorXd es2 = SchroedingerSimulator::Eigenstate(2);
    const Eigen::VectorXd es3 = SchroedingerSimulator::Eigenstate(3);
    NumpyRandom random(static_cast<std::uint32_t>(seed));
    Eigen::MatrixXd targets(num_targets, kStateSize);
    for (int s = 0; s < num_targets; ++s) {
      const Eigen::Vector2d amplitude = random.NormalPair().normalized();
      for (int phase = 0; phase < 2; ++phase) random.Rand();  // not used
      targets.row(s) = amplitude[0] * es2 + amplitude[1] * es3;
    }
    return targets;
  }

  static bool AreTargets(const Eigen::MatrixXd& data, std::string* error) {
    const Eigen::VectorXd norms = data.rowwise().norm();
    for (Eigen::Index s = 0; s < norms.size(); ++s) {
      if (std::abs(norms[s] - 1.0) < 1e-6) continue;  // single precision
      *error = fmt::format(
          "row {} of the data must have norm 1, found {:f}", s, norms[s]);
      return false;
    }
    return true;
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_QUANTUM_DIPOLE_H_
