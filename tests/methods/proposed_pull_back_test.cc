// Pull-backs as proposals inside ceres::Solve: scale-invariant physics training
// and its combinations.

#include <cctype>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/cost.h"
#include "invgrad/method.h"
#include "invgrad/methods/pull_back_method.h"
#include "invgrad/minimize.h"
#include "invgrad/proposal.h"
#include "invgrad/train.h"
#include "invgrad/update_callback.h"
#include "problems/ceres_problem.h"
#include "problems/problems.h"

namespace invgrad {
namespace proposed_pull_back_test {

using Eigen::VectorXd;

TEST(ProposedPullBack, ItsSettingsBelongToItsParts) {
  Method method;
  std::string error;
  ASSERT_TRUE(ParseMethod(
      "ceres_lm+newton/inverse/half_inverse:step_size=0.5:updates=2:"
      "initial_trust_region_radius=10",
      &method,
      &error))
      << error;
  const Phase& phase = method.last_phase();
  ASSERT_NE(phase.ceres, nullptr);
  ASSERT_NE(phase.pull_back, nullptr);
  EXPECT_EQ(phase.rule->name, "half_inverse");
  EXPECT_EQ(phase.rule_settings, (Settings{{"step_size", "0.5"}}));
  EXPECT_EQ(phase.pull_back->updates(), 2);
  EXPECT_EQ(phase.CeresOptions().initial_trust_region_radius, 10.0);
}

TEST(ProposedPullBack, SipInvertsTheNetworkToo) {
  Method method;
  std::string error;
  ASSERT_TRUE(ParseMethod("ceres_dogleg+sip", &method, &error)) << error;
  EXPECT_EQ(method.last_phase().rule->name, "levenberg_marquardt");
  EXPECT_EQ(method.last_phase().pull_back->updates(), 3);
  ASSERT_TRUE(ParseMethod("ceres_lm+sip:updates=5", &method, &error)) << error;
  EXPECT_EQ(method.last_phase().pull_back->updates(), 5);
}

TEST(ProposedPullBack, SaysWhatIsWrong) {
  Method method;
  for (const auto& [text, part] :
       std::vector<std::pair<std::string, std::string>>{
           {"ceres_bfgs+sip", "ceres_lm and ceres_dogleg"},
           {"ceres_lm+newton/inverse", "LOSS/SIMULATOR/RULE"},
           {"ceres_lm+newton/invers/adam", "invers"},
           {"ceres_lm+sip:update=3", "updates"}}) {
    std::string error;
    EXPECT_FALSE(ParseMethod(text, &method, &error));
    EXPECT_NE(error.find(part), std::string::npos) << error;
  }
}

// Of the same problem, start and iterations: a solve with proposals, and the
// training run of the method, never end above the plain solve and run.
class OfANetwork : public testing::TestWithParam<std::string> {};

TEST_P(OfANetwork, IsNeverWorseThanThePlainSolve) {
  const std::string specification = "toy_network:num_samples=32";
  const auto solve = [&](bool has_proposals) {
    CeresProblem problem;
    std::string error;
    EXPECT_TRUE(CreateCeresProblem(specification, {}, &problem, &error))
        << error;
    ceres::Solver::Options options;
    options.max_num_iterations = 20;
    options.linear_solver_type = ceres::DENSE_QR;
    options.logging_type = ceres::SILENT;
    std::unique_ptr<UpdateCallback> callback;
    if (has_proposals) {
      const ProposalFunction function =
          ScaleInvariantProposal(*problem.model,
                                 problem.data,
                                 problem.unknowns->data(),
                                 problem.inverse,
                                 GetParam(),
                                 &error);
      EXPECT_TRUE(function) << error;
      callback =
          std::make_unique<UpdateCallback>(function, problem.problem.get());
      callback->AddTo(&options);
    }
    ceres::Solver::Summary summary;
    ceres::Solve(options, problem.problem.get(), &summary);
    if (has_proposals) {
      EXPECT_GT(callback->summary().num_proposed, 0)
          << callback->summary().BriefReport();
    }
    return summary.final_cost;
  };
  EXPECT_LE(solve(true), solve(false));
}

TEST_P(OfANetwork, TrainsByItsText) {
  PhysicsProblem problem;
  std::string error;
  ASSERT_TRUE(
      CreateProblem("toy_network:num_samples=32", nullptr, &problem, &error))
      << error;
  const LearningProblem& learning = *problem.learning;
  TrainOptions options;
  options.max_num_steps = 20;
  options.inverse = learning.inverse;
  const TrainResult result =
      Train(*learning.model, learning.train, "ceres_lm+" + GetParam(), options);
  EXPECT_EQ(result.error, "");
  EXPECT_LT(result.history.back().train_loss,
            0.5 * result.history.front().train_loss);
  EXPECT_NE(result.summary.message.find("proposed"), std::string::npos)
      << result.summary.message;
}

INSTANTIATE_TEST_SUITE_P(
    Methods,
    OfANetwork,
    testing::Values("sip",
                    "newton/numerical/geodesic:updates=3",
                    "newton/half_inverse/gauss_newton:truncation=1e-3",
                    "newton/joint/gauss_newton:truncation=1e-3"),
    [](const auto& info) {
      std::string name = info.param;
      for (char& c : name) {
        if (std::isalnum(static_cast<unsigned char>(c)) == 0) {
          c = '_';
        }
      }
      return name;
    });

// A point without a network: the inverse leads to the solution at once.
TEST(ProposedPullBack, SolvesPointProblems) {
  PhysicsProblem problem;
  std::string error;
  ASSERT_TRUE(CreateProblem("sine_point", nullptr, &problem, &error)) << error;
  const auto minimize = [&](const std::string& text, int* num_steps) {
    Method method;
    EXPECT_TRUE(ParseMethod(text, &method, &error)) << error;
    PointObjective objective = problem.point->MakeObjective();
    std::vector<VectorXd> path;
    MinimizerOptions options;
    MinimizerSummary summary;
    EXPECT_TRUE(MinimizeByMethod(method,
                                 options,
                                 problem.point->inverse,
                                 &objective,
                                 &path,
                                 &summary,
                                 &error))
        << error;
    *num_steps = summary.num_steps();
    return summary.final_cost;
  };
  int plain_steps = 0;
  int num_steps = 0;
  const double plain = minimize("ceres_lm", &plain_steps);
  EXPECT_LE(minimize("ceres_lm+physical_gradient", &num_steps), plain + 1e-12);
  EXPECT_LE(minimize("ceres_lm+newton/inverse/gauss_newton", &num_steps),
            plain + 1e-12);
}

TEST(ScaleInvariantProposal, SaysWhatIsWrong) {
  CeresProblem problem;
  std::string error;
  ASSERT_TRUE(
      CreateCeresProblem("toy_network:num_samples=8", {}, &problem, &error));
  const auto make = [&](const std::string& method) {
    return ScaleInvariantProposal(*problem.model,
                                  problem.data,
                                  problem.unknowns->data(),
                                  problem.inverse,
                                  method,
                                  &error);
  };
  EXPECT_FALSE(make("half_inverse"));
  EXPECT_NE(error.find("LOSS/SIMULATOR/RULE"), std::string::npos) << error;
  EXPECT_FALSE(make("newton/invers/adam"));
  EXPECT_NE(error.find("inverse"), std::string::npos) << error;
}

// An inverse that fails or is wrong gives no worse end.
TEST(ScaleInvariantProposal, SurvivesABadInverse) {
  const auto nan = Inverse([](const auto& y, const auto&) {
    return std::optional<VectorXd>(VectorXd::Constant(y.size(), std::nan("")));
  });
  const auto wrong_size = Inverse([](const auto&, const auto&) {
    return std::optional<VectorXd>(VectorXd::Ones(17));
  });
  for (const auto& inverse : {nan, wrong_size}) {
    CeresProblem problem;
    std::string error;
    ASSERT_TRUE(
        CreateCeresProblem("toy_network:num_samples=16", {}, &problem, &error));
    const ProposalFunction function =
        ScaleInvariantProposal(*problem.model,
                               problem.data,
                               problem.unknowns->data(),
                               inverse,
                               "sip",
                               &error);
    ASSERT_TRUE(function) << error;
    UpdateCallback callback(function, problem.problem.get());
    ceres::Solver::Options options;
    options.max_num_iterations = 10;
    options.logging_type = ceres::SILENT;
    callback.AddTo(&options);
    ceres::Solver::Summary summary;
    ceres::Solve(options, problem.problem.get(), &summary);
    EXPECT_LT(summary.final_cost, summary.initial_cost);
    EXPECT_TRUE(problem.unknowns->allFinite());
  }
}

}  // namespace proposed_pull_back_test
}  // namespace invgrad
