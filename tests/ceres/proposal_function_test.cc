// Proposals of a function inside ceres::Solve (proposal.h), and bounds.

#include <cmath>
#include <limits>
#include <string>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/rotation.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/proposal.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"
#include "tests/ceres/callback_problems.h"
#include "tests/support/rosenbrock.h"

namespace invgrad {
namespace proposal_function_test {

// r = (1.5 + sin 3x - 0.02 x, 0.2 (x - 4), 0.03 y): a minimum in each period.
struct Waves {
  template <typename T>
  bool operator()(const T* x, const T* y, T* r) const {
    using std::sin;
    r[0] = 1.5 + sin(3.0 * x[0]) - 0.02 * x[0];
    r[1] = 0.2 * (x[0] - 4.0);
    r[2] = 0.03 * y[0];
    return true;
  }
};

struct WaveProblem {
  double x = -4.0;
  double y = 1.0;
  double held = 7.0;  // constant
  ceres::Problem problem;

  WaveProblem() {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Waves, 3, 1, 1>(new Waves),
        nullptr,
        &x,
        &y);
    problem.AddParameterBlock(&held, 1);
    problem.SetParameterBlockConstant(&held);
  }
  double Solve(UpdateCallback* callback) {
    const ceres::Solver::Options options = SolverOptions(callback);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    EXPECT_TRUE(summary.IsSolutionUsable()) << summary.message;
    return summary.final_cost;
  }
};

TEST(ProposalFunction, LeadsOutOfALocalMinimum) {
  WaveProblem plain;
  const double local = plain.Solve(nullptr);
  WaveProblem p;
  int num_calls = 0;
  UpdateCallback callback(
      [&](const ProblemState& x, ProblemState* candidate) {
        ++num_calls;
        EXPECT_EQ(x(&p.held)[0], 7.0);
        EXPECT_TRUE(x.is_constant(&p.held));
        EXPECT_FALSE(x.is_constant(&p.x));
        EXPECT_EQ((*candidate)(&p.y)[0], x(&p.y)[0]);
        (*candidate)(&p.x)[0] = 3.7;
        return true;
      },
      &p.problem);
  const double found = p.Solve(&callback);
  EXPECT_GT(num_calls, 0);
  EXPECT_GT(callback.summary().num_accepted, 0)
      << callback.summary().BriefReport();
  EXPECT_LT(found, 0.5 * local);
  EXPECT_NEAR(p.x, 3.7, 0.5);
}

TEST(ProposalFunction, HasNoEffectWithoutACandidate) {
  WaveProblem plain;
  const double local = plain.Solve(nullptr);
  WaveProblem p;
  UpdateCallback callback(
      [&](const ProblemState&, ProblemState* candidate) {
        (*candidate)(&p.x)[0] = 3.7;
        p.x = 100.0;  // not what a proposal should do: it is undone
        return false;
      },
      &p.problem);
  EXPECT_EQ(p.Solve(&callback), local);
  EXPECT_EQ(p.x, plain.x);
  EXPECT_EQ(callback.summary().num_proposed, 0);
  EXPECT_NE(callback.summary().message.find("no candidate"), std::string::npos)
      << callback.summary().message;
}

TEST(ProposalFunction, NamesTheBlockOfABadCandidate) {
  WaveProblem p;
  double value = std::numeric_limits<double>::quiet_NaN();
  UpdateCallback callback(
      [&](const ProblemState&, ProblemState* candidate) {
        (*candidate)(&p.y)[0] = value;
        return true;
      },
      &p.problem);
  p.Solve(&callback);
  EXPECT_EQ(callback.summary().num_proposed, 0);
  EXPECT_NE(callback.summary().message.find("block 1"), std::string::npos)
      << callback.summary().message;
  EXPECT_NE(callback.summary().message.find("not finite"), std::string::npos);
}

TEST(ProposalFunction, UnknownAndConstantBlocksAreTheCallersMistakes) {
  WaveProblem p;
  double other = 0.0;
  const auto solve = [&](const ProposalFunction& function) {
    UpdateCallback callback(function, &p.problem);
    p.Solve(&callback);
  };
  EXPECT_DEATH(solve([&](const ProblemState& x, ProblemState*) {
                 return x(&other)[0] > 0.0;
               }),
               "not a parameter block");
  EXPECT_DEATH(solve([&](const ProblemState&, ProblemState* candidate) {
                 (*candidate)(&p.held)[0] = 1.0;
                 return true;
               }),
               "constant parameter block");
  EXPECT_DEATH(UpdateCallback(ProposalFunction(), &p.problem), "empty");
}

// The true rotation is accepted with either sign of the quaternion, and one
// that is not of unit length is not proposed.
TEST(ProposalFunction, RespectsManifolds) {
  for (const double factor : {1.0, -1.0, 1.1}) {
    SCOPED_TRACE(factor);
    PoseProblem p;
    UpdateCallback callback(
        [&](const ProblemState&, ProblemState* candidate) {
          for (int i = 0; i < 4; ++i) {
            (*candidate)(p.q)[i] = factor * PoseProblem::kTruth[i];
          }
          std::copy_n(PoseProblem::kShift, 3, (*candidate)(p.t));
          return true;
        },
        &p.problem);
    const ceres::Solver::Options options = SolverOptions(&callback);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &p.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
    if (factor == 1.1) {
      EXPECT_EQ(callback.summary().num_proposed, 0);
      EXPECT_NE(callback.summary().message.find("not on its manifold"),
                std::string::npos)
          << callback.summary().message;
    } else {
      EXPECT_GT(callback.summary().num_accepted, 0)
          << callback.summary().BriefReport();
    }
  }
}

TEST(ProposalFunction, SeveralCallbacksFollowEachOther) {
  WaveProblem p;
  const auto jump = [&](double to) {
    return [&p, to](const ProblemState&, ProblemState* candidate) {
      (*candidate)(&p.x)[0] = to;
      return true;
    };
  };
  double cost = std::numeric_limits<double>::infinity();
  for (const double to : {-1.0, 1.6, 3.7}) {
    UpdateCallback callback(jump(to), &p.problem);
    const double next = p.Solve(&callback);
    EXPECT_LE(next, cost);
    cost = next;
  }
  PowerRule rule(1.0);
  UpdateCallback callback(&rule, &p.problem);
  EXPECT_LE(p.Solve(&callback), cost);
  // A second solve with the same callback, from the first start.
  WaveProblem plain;
  p.x = plain.x;
  p.y = plain.y;
  EXPECT_LE(p.Solve(&callback), plain.Solve(nullptr));
}

// --- Bounds ---

class BoundedRosenbrock : public testing::TestWithParam<double> {
 protected:
  // The minimum of the problem with y <= upper.
  static double Plain(double upper, TwoBlockRosenbrock* p) {
    p->problem.SetParameterUpperBound(&p->y, 0, upper);
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(nullptr), &p->problem, &summary);
    return summary.final_cost;
  }
};

// Never worse than the plain solve, and feasible: with the bound active (below
// 1) and not.
TEST_P(BoundedRosenbrock, RulesAndFunctionsRespectBounds) {
  TwoBlockRosenbrock plain;
  plain.y = 0.0;
  const double cost = Plain(GetParam(), &plain);
  TwoBlockRosenbrock p;
  p.y = 0.0;
  p.problem.SetParameterUpperBound(&p.y, 0, GetParam());
  PowerRule rule(0.5);
  const auto solve = [&](UpdateCallback* callback) {
    ceres::Solver::Options options = SolverOptions(callback);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &p.problem, &summary);
    EXPECT_LE(p.y, GetParam());
    EXPECT_LE(summary.final_cost, cost + 1e-12);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE)
        << summary.message << callback->summary().BriefReport();
  };
  {
    UpdateCallback callback(&rule, &p.problem);
    solve(&callback);
    EXPECT_GT(callback.summary().num_proposed, 0);
  }
  p.x = -1.2;
  p.y = 0.0;
  UpdateCallback callback(
      [&](const ProblemState&, ProblemState* candidate) {
        (*candidate)(&p.x)[0] = 0.9;
        (*candidate)(&p.y)[0] = 5.0;  // outside: projected
        return true;
      },
      &p.problem);
  solve(&callback);
}

INSTANTIATE_TEST_SUITE_P(ActiveAndNot,
                         BoundedRosenbrock,
                         testing::Values(0.5, 2.0));

TEST(UpdateCallback, GivesTheLineSearchBack) {
  TwoBlockRosenbrock p;
  p.problem.SetParameterUpperBound(&p.y, 0, 2.0);
  PowerRule rule(0.5);
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Options options;
  const int users = options.max_num_line_search_step_size_iterations;
  callback.AddTo(&options);
  EXPECT_EQ(options.max_num_line_search_step_size_iterations, 0);
  p.problem.SetParameterUpperBound(&p.y, 0, std::numeric_limits<double>::max());
  callback.AddTo(&options);
  EXPECT_EQ(options.max_num_line_search_step_size_iterations, users);
}

struct Distance {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] - 7.0;
    return true;
  }
};

// The model of a linear problem is exact, so that Ceres widens the region after
// every step: from a small one many times, from its default not.
TEST(ProposalFunction, TheReportNamesATrustRegionThatIsTooSmall) {
  for (const double radius : {1e-4, 1e4}) {
    double x = 0.0;
    ceres::Problem problem;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Distance, 1, 1>(new Distance),
        nullptr,
        &x);
    UpdateCallback callback(
        [](const ProblemState&, ProblemState*) { return false; }, &problem);
    ceres::Solver::Options options;
    options.initial_trust_region_radius = radius;
    callback.AddTo(&options);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    EXPECT_NEAR(x, 7.0, 1e-3);
    const bool is_small = radius < 1.0;
    EXPECT_EQ(callback.summary().num_limited_steps >= 8, is_small);
    EXPECT_EQ(callback.summary().BriefReport().find(
                  "a larger initial_trust_region_radius may save") !=
                  std::string::npos,
              is_small)
        << callback.summary().BriefReport();
  }
}

}  // namespace proposal_function_test
}  // namespace invgrad
