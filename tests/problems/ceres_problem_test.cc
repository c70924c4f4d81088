// Our problems as ordinary ceres::Problems.

#include "problems/ceres_problem.h"

#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "problems/problems.h"

namespace invgrad {
namespace ceres_problem_test {

class EveryCeresProblem : public testing::TestWithParam<std::string> {};

// As small as the problem allows.
std::string Small(const std::string& name) {
  for (const std::string settings : {":resolution=8:num_samples=6",
                                     ":num_samples=6",
                                     ":num_interior=16:num_boundary=8",
                                     ":num_t=2:num_x=8",
                                     ":num_x=4:num_y=4",
                                     ":num_points=16:num_face=2"}) {
    PhysicsProblem problem;
    std::string error;
    if (CreateProblem(name + settings, nullptr, &problem, &error)) {
      return name + settings;
    }
  }
  return name;
}

TEST_P(EveryCeresProblem, HasTheModelsCostAndGradient) {
  for (const int samples_per_block : {0, 4}) {
    SCOPED_TRACE(samples_per_block);
    ModelBlockOptions options;
    options.samples_per_block = samples_per_block;
    CeresProblem problem;
    std::string error;
    if (!CreateCeresProblem(Small(GetParam()), options, &problem, &error)) {
      EXPECT_NE(error.find("not a squared norm"), std::string::npos) << error;
      return;
    }
    LinearizationParts parts;
    parts.gradient = true;
    Linearization at;
    ASSERT_TRUE(problem.model->Linearize(
        *problem.unknowns, problem.data, parts, &at, &error))
        << error;
    ceres::Problem::EvaluateOptions evaluate;
    evaluate.parameter_blocks =
        WeightBlocks(problem.model->network(), problem.unknowns->data());
    double cost = 0.0;
    std::vector<double> gradient;
    ASSERT_TRUE(problem.problem->Evaluate(
        evaluate, &cost, nullptr, &gradient, nullptr));
    // The same terms, summed in another order.
    constexpr double kTolerance = 1e-10;
    EXPECT_NEAR(cost, at.cost, kTolerance * at.cost);
    EXPECT_LE((Eigen::Map<Eigen::VectorXd>(gradient.data(), gradient.size()) -
               at.gradient)
                  .norm(),
              kTolerance * at.gradient.norm());
  }
}

std::vector<std::string> Names() {
  std::vector<std::string> names;
  // The dense Jacobian of the plume's 20 time steps takes a minute.
  for (const ProblemRow& row : Problems()) {
    if (row.name == "plume_initial" || row.name == "more_garbow_hillstrom") {
      continue;  // the latter is one already
    }
    names.push_back(row.name);
  }
  return names;
}
INSTANTIATE_TEST_SUITE_P(Problems,
                         EveryCeresProblem,
                         testing::ValuesIn(Names()),
                         [](const auto& info) { return info.param; });

TEST(CreateCeresProblem, SaysWhatIsWrong) {
  CeresProblem problem;
  std::string error;
  EXPECT_FALSE(CreateCeresProblem("oscilator_chain", {}, &problem, &error));
  EXPECT_NE(error.find("oscillator_chain"), std::string::npos) << error;
  EXPECT_FALSE(CreateCeresProblem("quantum_dipole", {}, &problem, &error));
  EXPECT_NE(error.find("not a squared norm"), std::string::npos) << error;
  EXPECT_EQ(problem.problem, nullptr);
}

TEST(CreateCeresProblem, CeresSolvesIt) {
  CeresProblem problem;
  std::string error;
  ModelBlockOptions blocks;
  blocks.samples_per_block = 8;
  ASSERT_TRUE(CreateCeresProblem(
      "oscillator_chain:num_samples=16", blocks, &problem, &error))
      << error;
  ceres::Solver::Options options;
  options.max_num_iterations = 10;
  options.num_threads = 2;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  ceres::Solver::Summary summary;
  ceres::Solve(options, problem.problem.get(), &summary);
  EXPECT_LT(summary.final_cost, 0.1 * summary.initial_cost);
}

}  // namespace ceres_problem_test
}  // namespace invgrad
