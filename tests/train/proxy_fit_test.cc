// How SIP converges where the network fits the proxy exactly, and where the
// inverse is a descent.

#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/train.h"
#include "tests/support/create_problem.h"
#include "tests/support/random_matrix.h"
#include "tests/support/train_problem.h"

namespace invgrad {
namespace proxy_fit_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Exp {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::exp;
    y[0] = exp(x[0]);
    return true;
  }
};

// y = exp(x) behind a linear network with more weights than samples, which a
// Gauss-Newton step on the proxy fits exactly.
struct LinearNetwork {
  static constexpr int kNumInputs = 8;
  static constexpr int kNumSamples = 6;
  Model model{DenseNetwork({kNumInputs, 1}, Activation::kTanh),
              std::make_shared<AutoDiffSimulator<Exp, 1, 1>>(),
              std::make_shared<SquaredNormLoss>(1, 0.5),
              Reduction::kSum};
  TrainingData data{RandomMatrix(kNumInputs, kNumSamples, 1),
                    (1.5 + RandomMatrix(1, kNumSamples, 2).array()).matrix()};

  MatrixXd OutputsAfter(int num_steps, const std::string& method) const {
    TrainOptions options;
    options.batch_size = 0;
    options.max_num_steps = num_steps;
    options.seed = 1;
    options.inverse = Inverse(
        [](const auto& y, const auto& /*x_now*/) -> std::optional<VectorXd> {
          if (!(y[0] > 0.0)) return std::nullopt;
          return VectorXd::Constant(1, std::log(y[0]));
        });
    const TrainResult result = Train(model, data, method, options);
    EXPECT_EQ(result.error, "");
    EXPECT_EQ(result.summary.num_steps, num_steps) << result.summary.message;
    MatrixXd y;
    std::string error;
    EXPECT_TRUE(model.Predict(result.weights, data.train, &y, &error)) << error;
    return y;
  }
};

// y_k - y* = (1 - eta)^k (y_0 - y*) for every sample, although P is not linear.
TEST(ProxyFit, AGlobalInverseConvergesExponentially) {
  const LinearNetwork problem;
  const MatrixXd& target = problem.data.train.targets;
  for (const double eta : {0.1, 0.5, 0.9, 1.0}) {
    SCOPED_TRACE(eta);
    const std::string method =
        "newton/inverse/gauss_newton:y_step_size=" + std::to_string(eta) +
        ":truncation=1e-12";
    const MatrixXd error = problem.OutputsAfter(1, method) - target;
    for (const int k : {1, 2, 5, 12}) {
      const MatrixXd after = problem.OutputsAfter(k, method) - target;
      const double factor = std::pow(1.0 - eta, k - 1);
      EXPECT_LT((after - factor * error).norm(), 1e-12) << k;
    }
    EXPECT_GT(error.norm(), eta < 1.0 ? 0.05 : 0.0);
  }
}

// A gradient step of the network does not fit the proxy, and the errors of the
// samples mix.
TEST(ProxyFit, AGradientStepOfTheNetworkConvergesSlower) {
  const LinearNetwork problem;
  const MatrixXd& target = problem.data.train.targets;
  const auto error = [&](const std::string& rule) {
    return (problem.OutputsAfter(12, "newton/inverse/" + rule) - target).norm();
  };
  EXPECT_GT(error("gradient_descent:step_size=0.05"),
            1e3 * error("gauss_newton:y_step_size=0.7"));
}

TrainResult TrainSine(const std::string& method) {
  TrainOptions options;
  options.max_num_steps = 20;
  options.batch_size = 100;
  return TrainProblem(CreateLearningProblem("sine:xi=2:phi=10:num_samples=200"),
                      method,
                      options);
}

// With one gradient step as the inverse SIP is the gradient of the chain.
TEST(ProxyFit, OneInnerStepIsDifferentiablePhysics) {
  const VectorXd inner =
      TrainSine(
          "newton/gradient_descent/gradient_descent:step_size=0.5:"
          "inner_steps=1:inner_step_size=1e-3")
          .weights;
  const VectorXd chain = TrainSine("gradient_descent:step_size=5e-4").weights;
  EXPECT_LT((inner - chain).norm(), 1e-12 * chain.norm());
}

// With converged ones it is SIP.
TEST(ProxyFit, ConvergedInnerStepsAreTheInverse) {
  const LinearNetwork problem;
  const MatrixXd inverse =
      problem.OutputsAfter(12, "newton/inverse/adam:step_size=0.02");
  const auto distance = [&](int inner_steps) {
    return (problem.OutputsAfter(12,
                                 "newton/gradient_descent/adam:step_size=0.02:"
                                 "inner_step_size=0.05:inner_steps=" +
                                     std::to_string(inner_steps)) -
            inverse)
        .norm();
  };
  EXPECT_LT(distance(2000), 1e-9);
  EXPECT_GT(distance(1), 1e-4);
}

}  // namespace proxy_fit_test
}  // namespace invgrad
