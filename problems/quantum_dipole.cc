#include "problems/quantum_dipole.h"

#include <cmath>
#include <cstdint>
#include <memory>

#include "fmt/core.h"
#include "invgrad/io/numpy_random.h"

namespace invgrad {

namespace {

constexpr int kStateSize = SchroedingerSimulator::kStateSize;

Eigen::MatrixXd DrawTargets(int num_targets, int seed) {
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

bool AreTargets(const Eigen::MatrixXd& data, std::string* error) {
  const Eigen::VectorXd norms = data.rowwise().norm();
  for (Eigen::Index s = 0; s < norms.size(); ++s) {
    if (std::abs(norms[s] - 1.0) < 1e-6) continue;  // single precision
    *error = fmt::format(
        "row {} of the data must have norm 1, found {:f}", s, norms[s]);
    return false;
  }
  return true;
}

}  // namespace

bool RescaledInfidelity::Evaluate(const double* y,
                                  const double* target,
                                  double* loss,
                                  double* gradient,
                                  double* hessian) const {
  if (!infidelity_.Evaluate(y, target, loss, gradient, hessian)) return false;
  using State = Eigen::Matrix<double, kStateSize, 1>;
  // Real and imaginary parts as one real vector: Re <y*|y>.
  const double overlap =
      Eigen::Map<const State>(target).dot(Eigen::Map<const State>(y));
  const double factor = 1.0 / std::abs(overlap);
  bool is_finite = true;
  const auto rescale = [&](double* values, int size) {
    if (values == nullptr) return;
    Eigen::Map<Eigen::VectorXd>(values, size) *= factor;
    is_finite &= AllFinite(values, size);
  };
  rescale(gradient, kStateSize);
  rescale(hessian, kStateSize * kStateSize);
  return is_finite;
}

bool QuantumDipole::Create(LearningProblem* problem, std::string* error) const {
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
  std::shared_ptr<const Loss> loss;
  if (rescale) {
    loss = std::make_shared<RescaledInfidelity>();
  } else {
    loss = std::make_shared<AutoDiffLoss<Infidelity, kStateSize>>();
  }
  problem->model = std::make_shared<Model>(
      DenseNetwork({kStateSize, 20, 20, 20, num_steps}, Activation::kTanh),
      std::make_shared<SchroedingerSimulator>(num_steps, dt),
      loss,
      Reduction::kMean);
  return true;
}

}  // namespace invgrad
