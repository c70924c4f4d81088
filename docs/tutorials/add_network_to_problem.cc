// Physics and a network in a ceres::Problem of your own: a network learns to
// throw a ball against the wind. add_network_to_problem.md explains it.
#include <cmath>
#include <cstdio>

#include "ceres/normal_prior.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/cost.h"
#include "invgrad/dense_network.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/random.h"
#include "invgrad/update_callback.h"

constexpr double kGravity = 9.81;  // [m/s^2]

// [simulator]
struct Throw {  // velocity [m/s], wind [m/s^2] -> distance and height [m]
  template <typename T, typename C>
  bool operator()(const T* v, const C* wind, T* y) const {
    const T t = 2.0 / kGravity * v[1];
    y[0] = v[0] * t + 0.5 * wind[0] * t * t;
    y[1] = v[1] * v[1] / (2.0 * kGravity);
    return true;
  }
};
// [/simulator]

int main(int argc, char**) {
  // [model]
  const auto network = std::make_shared<invgrad::DenseNetwork>(
      std::vector<int>{3, 16, 2}, invgrad::Activation::kTanh);
  const invgrad::Model model(
      network,
      std::make_shared<invgrad::AutoDiffSimulator<Throw, 2, 2, 1>>(),
      std::make_shared<invgrad::SquaredNormLoss>(2, 0.5),
      invgrad::Reduction::kSum);
  invgrad::NumpyRandom random(1);
  // [samples]
  invgrad::DataSet data;
  data.targets = 1.0 + 9.0 * random.Rand(2, 100).array();
  data.contexts = -2.0 * random.Rand(1, 100);
  data.inputs.resize(3, 100);
  data.inputs << data.targets / 10.0, data.contexts;
  // [/samples]
  data.targets.row(0).head(5).setConstant(15.0);  // wrong measurements
  Eigen::VectorXd weights =
      network->InitialWeights(invgrad::Initialization::kPytorch, &random);
  // [/model]
  // [problem]
  ceres::Problem problem;
  AddModelToProblem(model,
                    data,
                    weights.data(),
                    &problem,
                    {/*samples_per_block=*/1, new ceres::HuberLoss(0.1)});
  const auto blocks = WeightBlocks(*network, weights.data());
  for (double* block : blocks) {  // a prior on the weights of each neuron
    const int size = problem.ParameterBlockSize(block);
    const Eigen::MatrixXd A = 1e-3 * Eigen::MatrixXd::Identity(size, size);
    problem.AddResidualBlock(
        new ceres::NormalPrior(A, Eigen::VectorXd::Zero(size)), nullptr, block);
  }
  problem.AddResidualBlock(
      new invgrad::NetworkCost(network,
                               Eigen::Vector3d(0.5, 0.5, 0.0),
                               Eigen::Vector2d(2.476, 9.905)),
      nullptr,
      blocks);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 200;
  // [/problem]
  // [proposal]
  const auto inverse =
      invgrad::Inverse([](const auto& y,
                          const auto&,
                          const auto& wind) -> std::optional<Eigen::VectorXd> {
        if (y[1] <= 0.0) return std::nullopt;
        const double t = std::sqrt(8.0 * y[1] / kGravity);
        return Eigen::Vector2d(y[0] / t - 0.5 * wind[0] * t,
                               0.5 * kGravity * t);
      });
  std::string error;
  invgrad::UpdateCallback callback(
      ScaleInvariantProposal(
          model, data, weights.data(), inverse, "sip", &error),
      &problem);
  if (argc == 1) callback.AddTo(&options);  // with any argument: LM alone
  // [/proposal]
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  std::printf("%s\n%s\n",
              summary.BriefReport().c_str(),
              callback.summary().BriefReport().c_str());
  return summary.IsSolutionUsable() ? 0 : 1;
}
