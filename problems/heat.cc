#include "problems/heat.h"

#include <limits>
#include <memory>

#include "fmt/core.h"
#include "invgrad/chain/loss.h"
#include "problems/heat_states.h"
#include "problems/spectral_diffusion.h"

namespace invgrad {

namespace {

std::shared_ptr<const SpectralDiffusion> MakeSimulator(
    const HeatPhysics& physics, int rows) {
  const double dx = kHeatBoxSide / physics.resolution;
  return std::make_shared<SpectralDiffusion>(
      std::make_shared<FourierGrid>(rows, physics.resolution),
      physics.nu_t / (dx * dx));
}

// A column for each of `states`' columns.
Eigen::MatrixXd Diffuse(const Simulator& simulator,
                        const Eigen::MatrixXd& states) {
  Eigen::MatrixXd outputs(states.rows(), states.cols());
  for (Eigen::Index n = 0; n < states.cols(); ++n) {
    if (!simulator.Evaluate(
            states.col(n).data(), nullptr, outputs.col(n).data(), nullptr)) {
      // User data may overflow; DataSet::IsFinite reports this.
      outputs.col(n).setConstant(std::numeric_limits<double>::quiet_NaN());
    }
  }
  return outputs;
}

// The network has two hidden layers of `hidden` neurons.
bool CreateLearning(const HeatLearningOptions& options,
                    int rows,
                    int hidden,
                    const Eigen::MatrixXd* data,
                    LearningProblem* problem,
                    std::string* error) {
  const auto simulator = MakeSimulator(options.physics, rows);
  const int size = simulator->num_inputs();
  const auto generate = [&](int num_rows) {
    return RandomHeatStates(
        num_rows, rows, options.physics.resolution, options.data_seed);
  };
  if (!MakeData({options.num_samples,
                 size,
                 3.0 * size,
                 fmt::format(":resolution={}", options.physics.resolution)},
                data,
                generate,
                problem,
                error)) {
    return false;
  }
  DataSet all;
  all.solutions = problem->data.transpose();
  all.targets = Diffuse(*simulator, all.solutions);
  all.inputs = all.targets;
  SplitSamples(all, 128, problem);
  problem->metric = SolutionDistance("x_l1");
  problem->inverse =
      std::make_shared<HeatInverse>(simulator, options.physics.uncertainty);
  problem->num_epochs = 25;
  problem->model = std::make_shared<Model>(
      DenseNetwork({size, hidden, hidden, size}, Activation::kRelu),
      simulator,
      std::make_shared<SquaredNormLoss>(size, 0.5),
      Reduction::kSum);
  return true;
}

}  // namespace

bool Heat::Create(const Options& options,
                  const Eigen::MatrixXd* data,
                  LearningProblem* problem,
                  std::string* error) {
  return CreateLearning(
      options, options.physics.resolution, 128, data, problem, error);
}

bool Heat1d::Create(const Options& options,
                    const Eigen::MatrixXd* data,
                    LearningProblem* problem,
                    std::string* error) {
  return CreateLearning(options, 1, 64, data, problem, error);
}

bool HeatState::Create(const Options& options,
                       PointProblem* problem,
                       std::string* /*error*/) {
  const int n = options.physics.resolution;
  const auto simulator = MakeSimulator(options.physics, n);
  const Eigen::MatrixXd state =
      RandomHeatStates(1, n, n, options.data_seed).transpose();
  problem->target = Diffuse(*simulator, state);
  problem->simulator = simulator;
  problem->inverse =
      std::make_shared<HeatInverse>(simulator, options.physics.uncertainty);
  problem->loss = std::make_shared<SquaredNormLoss>(n * n, 0.5);
  problem->start = Eigen::VectorXd::Zero(n * n);
  problem->minimizer = state;
  problem->minimum = 0.0;
  problem->field_rows = n;
  return true;
}

}  // namespace invgrad
