// A network that throws a shuttlecock, as a part of another problem of Ceres,
// and the same problem by the physics: for trained_networks.cc.
#ifndef TRAINED_THROWER_H_
#define TRAINED_THROWER_H_

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "../tutorials/shuttlecock_flight.h"
#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/sized_cost_function.h"
#include "ceres/solver.h"
#include "glog/logging.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/random.h"
#include "invgrad/train.h"

namespace trained_networks {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;
using invgrad::Activation;
using invgrad::DenseNetwork;

using Places = std::vector<Vector2d>;  // t_i [m]

struct TrainedNetwork {
  DenseNetwork network;
  VectorXd weights;
};

// Places up to 9 m away, from 1 m below to 2 m above.
inline TrainedNetwork TrainThrower(Activation activation, int seed) {
  constexpr int kNumSamples = 1024;
  DenseNetwork network({2, 24, 24, 2}, activation);
  const invgrad::Model model(
      network,
      std::make_shared<invgrad::AutoDiffSimulator<Flight, 2, 2>>(),
      std::make_shared<invgrad::SquaredNormLoss>(2, 0.5),
      invgrad::Reduction::kMean);
  invgrad::NumpyRandom random(0);
  MatrixXd targets(2, kNumSamples);
  for (auto target : targets.colwise()) {
    target[0] = random.Uniform(-9.0, 9.0);
    target[1] = random.Uniform(-1.0, 2.0);
  }
  invgrad::TrainOptions options;
  options.max_num_steps = 300;
  options.batch_size = 64;
  options.seed = seed;
  const invgrad::TrainResult result = invgrad::Train(
      model,
      {targets, targets},
      "newton/numerical/half_inverse:step_size=auto:y_step_size=0.3",
      options);
  CHECK(result.error.empty()) << result.error;
  return {std::move(network), result.weights};
}

// f(t - (p, 0)) and its derivative with respect to p.
class SurrogateThrow final : public ceres::SizedCostFunction<2, 1> {
 public:
  SurrogateThrow(const TrainedNetwork* thrower, Vector2d place)
      : thrower_(*thrower), place_(std::move(place)) {}

  bool Evaluate(double const* const* p,
                double* x,
                double** dx_dp) const override {
    const MatrixXd y = place_ - Vector2d(p[0][0], 0.0);
    DenseNetwork::Activations pass;
    thrower_.network.Forward(thrower_.weights, y, false, &pass);
    Eigen::Map<Vector2d>{x} = pass.outputs;
    if (dx_dp != nullptr && dx_dp[0] != nullptr) {
      MatrixXd J;  // a column an output
      thrower_.network.InputJacobians(thrower_.weights, pass, &J);
      Eigen::Map<Vector2d>{dx_dp[0]} = -J.row(0).transpose();
    }
    return true;
  }

 private:
  const TrainedNetwork& thrower_;
  const Vector2d place_;
};

// w (P(x) - (t - (p, 0))); the other residual of a throw is x.
struct Arrival {
  Vector2d place;
  template <typename T>
  bool operator()(const T* p, const T* x, T* residual) const {
    constexpr double kWeight = 1e4;
    if (!Flight()(x, residual)) return false;
    residual[0] = kWeight * (residual[0] - (place[0] - p[0]));
    residual[1] = kWeight * (residual[1] - place[1]);
    return true;
  }
};

struct Velocity {
  template <typename T>
  bool operator()(const T* x, T* residual) const {
    residual[0] = x[0];
    residual[1] = x[1];
    return true;
  }
};

struct Design {
  double p = 0.0;       // [m]
  double energy = 0.0;  // 1/2 sum |x_i|^2 [J/kg]
  int num_iterations = 0;
};

inline Design Solve(double* p, ceres::Problem* problem) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, problem, &summary);
  return {
      *p, summary.final_cost, static_cast<int>(summary.iterations.size()) - 1};
}

inline Design SolveBySurrogate(const TrainedNetwork& thrower,
                               const Places& places) {
  double p = 0.0;
  ceres::Problem problem;
  for (const Vector2d& place : places) {
    problem.AddResidualBlock(new SurrogateThrow(&thrower, place), nullptr, &p);
  }
  return Solve(&p, &problem);
}

// With `fixed`, the least energy from there.
inline Design SolveByPhysics(const Places& places,
                             std::optional<double> fixed = std::nullopt) {
  double p = fixed.value_or(0.0);
  std::vector<Vector2d> x(places.size(), Vector2d(0.0, 5.0));
  ceres::Problem problem;
  for (size_t i = 0; i < places.size(); ++i) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Velocity, 2, 2>(new Velocity),
        nullptr,
        x[i].data());
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Arrival, 2, 1, 2>(
                                 new Arrival{places[i]}),
                             nullptr,
                             &p,
                             x[i].data());
  }
  if (fixed.has_value()) problem.SetParameterBlockConstant(&p);
  return Solve(&p, &problem);
}

}  // namespace trained_networks

#endif  // TRAINED_THROWER_H_
