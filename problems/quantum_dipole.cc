#include "problems/quantum_dipole.h"

#include <cmath>
#include <memory>

#include "invgrad/chain/autodiff_loss.h"
#include "invgrad/io/numpy_random.h"
#include "problems/sample_data.h"

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
  if (!CheckDataShape(data, kStateSize, error)) return false;
  for (Eigen::Index s = 0; s < data.rows(); ++s) {
    const double norm = data.row(s).norm();
    // As good as single precision is.
    if (!(std::abs(norm - 1.0) < 1e-6)) {
      *error = "row " + std::to_string(s) +
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
  SplitSamples(all, 16, problem);
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
