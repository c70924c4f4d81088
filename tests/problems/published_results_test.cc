// Numbers that others printed, reproduced.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/method.h"
#include "invgrad/minimize.h"
#include "invgrad/minimize/method_minimization.h"
#include "invgrad/random.h"
#include "invgrad/train.h"
#include "problems/problems.h"
#include "tests/support/train_problem.h"

namespace invgrad {
namespace published_results_test {

std::vector<Eigen::VectorXd> Path(const std::string& specification,
                                  int num_steps) {
  PhysicsProblem problem;
  std::string error;
  EXPECT_TRUE(CreateProblem("squared_component", nullptr, &problem, &error));
  std::vector<Method> methods;
  EXPECT_TRUE(ParseMethods(specification, &methods, &error)) << error;
  MinimizerOptions options;
  options.max_num_iterations = num_steps;
  PointObjective objective = problem.point->MakeObjective();
  std::vector<Eigen::VectorXd> path;
  MinimizerSummary summary;
  EXPECT_TRUE(MinimizeByMethod(methods.at(0),
                               options,
                               problem.point->inverse,
                               &objective,
                               &path,
                               &summary,
                               &error))
      << error;
  return path;
}

// How far the unit vector of the first step points along the diagonal (-1, -1).
double DiagonalLength(const std::vector<Eigen::VectorXd>& path) {
  const Eigen::VectorXd step = path[1] - path[0];
  return -step.sum() / step.norm();
}

// PBDL, physgrad-comparison: x after each of the ten iterations, as printed
// (single precision).
TEST(PhysgradComparison, GradientDescent) {
  const double printed[10][2] = {{2.94, 1.9200001},
                                 {2.8812, 1.6368846},
                                 {2.823576, 1.4614503},
                                 {2.7671044, 1.3365935},
                                 {2.7117622, 1.2410815},
                                 {2.657527, 1.1646168},
                                 {2.6043763, 1.1014326},
                                 {2.5522888, 1.0479842},
                                 {2.501243, 1.0019454},
                                 {2.4512184, 0.96171147}};
  const auto path = Path("gradient_descent:step_size=0.01", 10);
  ASSERT_EQ(path.size(), 11u);
  for (int k = 0; k < 10; ++k) {
    EXPECT_NEAR(path[k + 1][0], printed[k][0], 1e-6) << "iteration " << k;
    EXPECT_NEAR(path[k + 1][1], printed[k][1], 1e-6) << "iteration " << k;
  }
  EXPECT_NEAR(DiagonalLength(path), 1.053930, 1e-6);
}

// The physical gradient, by the inverse that the problem knows and by one that
// the library finds.
TEST(PhysgradComparison, PhysicalGradient) {
  const double printed[10][2] = {{2.1, 2.5099802},
                                 {1.4699999, 2.1000001},
                                 {1.0289999, 1.7569861},
                                 {0.72029996, 1.47},
                                 {0.50421, 1.2298902},
                                 {0.352947, 1.029},
                                 {0.24706289, 0.86092323},
                                 {0.17294402, 0.7203},
                                 {0.12106082, 0.60264623},
                                 {0.08474258, 0.50421}};
  for (const char* inverse : {"inverse", "numerical"}) {
    SCOPED_TRACE(inverse);
    const bool is_analytic = std::string(inverse) == "inverse";
    const auto path = Path(std::string("newton/") + inverse +
                               "/gradient_descent:step_size=1:y_step_size=0.3",
                           10);
    ASSERT_EQ(path.size(), 11u);
    for (int k = 0; k < 10; ++k) {
      const double tolerance = is_analytic ? 1e-6 : 1e-5;
      EXPECT_NEAR(path[k + 1][0], printed[k][0], tolerance) << k;
      EXPECT_NEAR(path[k + 1][1], printed[k][1], tolerance) << k;
      // Closed form: 3 (7/10)^k and 3 (7/10)^(k/2), a straight line in y.
      const double exact = is_analytic ? 1e-14 : 1e-6;
      EXPECT_NEAR(path[k + 1][0], 3.0 * std::pow(0.7, k + 1), exact);
      EXPECT_NEAR(path[k + 1][1], 3.0 * std::pow(0.7, 0.5 * (k + 1)), exact);
    }
    EXPECT_NEAR(DiagonalLength(path), 1.356443, 1e-6);
  }
}

TEST(PhysgradComparison, Newton) {
  const double printed[10][2] = {{2.0, 2.6666667},
                                 {1.3333333, 2.3703704},
                                 {0.88888884, 2.1069958},
                                 {0.59259254, 1.8728852},
                                 {0.39506167, 1.6647868},
                                 {0.26337445, 1.4798105},
                                 {0.17558296, 1.315387},
                                 {0.1170553, 1.1692328},
                                 {0.07803687, 1.0393181},
                                 {0.05202458, 0.92383826}};
  const auto path = Path("newton:step_size=0.333333333333333333", 10);
  ASSERT_EQ(path.size(), 11u);
  for (int k = 0; k < 10; ++k) {
    EXPECT_NEAR(path[k + 1][0], printed[k][0], 1e-6) << "iteration " << k;
    EXPECT_NEAR(path[k + 1][1], printed[k][1], 1e-6) << "iteration " << k;
    // Closed form: 3 (2/3)^k and 3 (8/9)^k.
    EXPECT_NEAR(path[k + 1][0], 3.0 * std::pow(2.0 / 3.0, k + 1), 1e-14);
    EXPECT_NEAR(path[k + 1][1], 3.0 * std::pow(8.0 / 9.0, k + 1), 1e-14);
  }
  EXPECT_NEAR(DiagonalLength(path), 1.264911, 1e-6);
}

// Train losses after each epoch on the linear chain with batches of 32.
std::vector<double> LossesOfTheLinearChain(const std::string& method,
                                           std::uint32_t seed,
                                           int num_epochs) {
  PhysicsProblem problem;
  std::string error;
  EXPECT_TRUE(CreateProblem("oscillator_chain", nullptr, &problem, &error));
  const LearningProblem& chain = *problem.learning;
  TrainOptions options;
  options.batch_size = 32;
  options.max_num_epochs = num_epochs;
  options.initial_weights = InitialWeights(chain, seed);
  const TrainResult result = TrainProblem(chain, method, options);
  EXPECT_EQ(result.summary.num_steps, 128 * num_epochs)
      << result.summary.message;
  std::vector<double> losses;
  for (const HistoryRow& row : result.history) {
    if (row.step > 0) losses.push_back(row.train_loss);
  }
  return losses;
}

// PBDL, physgrad-hig-code, printed output of the half-inverse run: 5.44e-5,
// 1.06e-5, 3.16e-6 and 1.19e-6 after epochs 1 to 4 (B = 32, eta = 1, tau =
// 1e-10). Weights and data are drawn anew, so a factor of two is allowed.
TEST(PhysgradHigCode, HalfInverseOnTheLinearChain) {
  const double printed[4] = {
      5.44398972e-05, 1.06443604e-05, 3.16352543e-06, 1.18576099e-06};
  std::vector<double> losses[4];
  for (const std::uint32_t seed : {1u, 2u, 3u}) {
    const std::vector<double> run = LossesOfTheLinearChain(
        "half_inverse:step_size=1:truncation=1e-10", seed, 4);
    ASSERT_EQ(run.size(), 4u);
    for (int i = 0; i < 4; ++i) losses[i].push_back(run[i]);
  }
  for (int i = 0; i < 4; ++i) {
    std::sort(losses[i].begin(), losses[i].end());
    const double median = losses[i][1];
    EXPECT_LT(median, 2.0 * printed[i]) << "epoch " << i + 1;
    EXPECT_GT(median, 0.5 * printed[i]) << "epoch " << i + 1;
  }
}

// Beyond what is published: with the exponent and the damping controlled by the
// gain, and nothing tuned, the loss after 5 epochs is 1.9e-9 where the
// published settings have 7e-8.
TEST(PhysgradHigCode, ControlGoesFurtherThanThePublishedSettings) {
  const std::vector<double> published =
      LossesOfTheLinearChain("half_inverse:step_size=1:truncation=1e-10", 1, 5);
  const std::vector<double> controlled =
      LossesOfTheLinearChain("power:step_size=auto:control=gain", 1, 5);
  EXPECT_LT(controlled.back(), 0.1 * published.back());
}

}  // namespace published_results_test
}  // namespace invgrad
