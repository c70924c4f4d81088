#include "problems/quantum_dipole.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "invgrad/chain/autodiff_loss.h"
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
  if (data.cols() != kStateSize || data.rows() < 2) {
    *error = "quantum_dipole: data must have shape (2 samples or more, " +
             std::to_string(kStateSize) + "), found (" +
             std::to_string(data.rows()) + ", " + std::to_string(data.cols()) +
             ")";
    return false;
  }
  for (Eigen::Index s = 0; s < data.rows(); ++s) {
    const double norm = data.row(s).norm();
    // As good as single precision is.
    if (!(std::abs(norm - 1.0) < 1e-6)) {
      *error = "quantum_dipole: row " + std::to_string(s) +
               " of the data must have norm 1, found " + std::to_string(norm);
      return false;
    }
  }
  return true;
}

}  // namespace

bool QuantumDipole::Create(const Options& options,
                           const Eigen::MatrixXd* data,
                           LearningProblem* problem,
                           std::string* error) {
  if (data != nullptr) {
    if (!AreTargets(*data, error)) return false;
    problem->data = *data;
  } else {
    problem->data = DrawTargets(2 * options.num_samples, options.data_seed);
  }
  DataSet all;
  all.inputs = problem->data.transpose();
  all.targets = all.inputs;
  all.contexts =
      SchroedingerSimulator::Eigenstate(1).replicate(1, all.num_samples());
  const int num_train = all.num_samples() / 2;
  problem->train = all.Range(0, num_train);
  problem->test = all.Range(num_train, all.num_samples() - num_train);
  problem->batch_size = std::min(16, num_train);
  problem->num_epochs = 25;
  problem->initialization = Initialization::kGlorotUniform;
  problem->model = std::make_shared<Model>(
      DenseNetwork({kStateSize, 20, 20, 20, options.num_steps},
                   Activation::kTanh),
      std::make_shared<SchroedingerSimulator>(options.num_steps, options.dt),
      std::make_shared<AutoDiffLoss<Infidelity, kStateSize>>(),
      Reduction::kMean);
  return true;
}

}  // namespace invgrad
