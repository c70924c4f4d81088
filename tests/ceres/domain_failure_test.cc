#include "invgrad/ceres/domain_failure.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/cost_function.h"
#include "ceres/evaluation_callback.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/sized_cost_function.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/update_callback.h"
#include "tests/ceres/callback_problems.h"
#include "tests/support/function_rule.h"

namespace invgrad {
namespace domain_failure_test {

using Reason = DomainFailure::Reason;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// r = log(a[0] + a[1] t) - y
struct Log {
  template <typename T>
  bool operator()(const T* a, T* r) const {
    const T sum = a[0] + t * a[1];
    if (returns_false && sum <= 0.0) return false;
    r[0] = log(sum) - y;
    return true;
  }
  double t, y;
  bool returns_false;
};

ceres::CostFunction* NewLog(double t, double y, bool returns_false) {
  return new ceres::AutoDiffCostFunction<Log, 1, 2>(
      new Log{t, y, returns_false});
}

// r = sqrt(b)
struct Root {
  template <typename T>
  bool operator()(const T* b, T* r) const {
    r[0] = sqrt(b[0]);
    return true;
  }
};

// One residual of all arguments, a function without derivatives.
class Any final : public ceres::CostFunction {
 public:
  using Function = std::function<bool(double const* const* x, double* r)>;
  Any(const std::vector<int>& sizes, Function function)
      : function_(std::move(function)) {
    *mutable_parameter_block_sizes() = sizes;
    set_num_residuals(1);
  }
  bool Evaluate(double const* const* x, double* r, double** J) const override {
    for (std::size_t b = 0; J != nullptr && b < parameter_block_sizes().size();
         ++b) {
      if (J[b] != nullptr) std::fill_n(J[b], parameter_block_sizes()[b], 1.0);
    }
    return function_(x, r);
  }

 private:
  Function function_;
};

class DomainFailureTest : public testing::Test {
 protected:
  void Add(Any::Function function, const std::vector<double*>& blocks) {
    std::vector<int> sizes;
    for (const double* block : blocks) {
      sizes.push_back(problem_.ParameterBlockSize(block));
    }
    problem_.AddResidualBlock(
        new Any(sizes, std::move(function)), nullptr, blocks);
  }
  bool Explain(const Eigen::VectorXd& good, const Eigen::VectorXd& bad) {
    const ProblemStructure structure = ReadStructure(problem_, {});
    return ExplainDomainFailure(options_, structure, good, bad, &failure_);
  }

  ceres::Problem problem_;
  DomainFailure::Options options_;
  DomainFailure failure_;
};

TEST_F(DomainFailureTest, NamesBlockAndComponent) {
  double a[2] = {1.0, 2.0};
  for (const double t : {0.0, 1.0, 2.0}) {
    problem_.AddResidualBlock(NewLog(t, 0.0, true), nullptr, a);
  }
  options_.block_name = [&](const double* values) {
    return values == a ? "a" : "";
  };
  const Eigen::Vector2d good(1.0, 2.0), bad(1.5, -0.8);
  ASSERT_TRUE(Explain(good, bad));
  EXPECT_EQ(failure_.ToText(),
            "residual block 2 (cost function returned false): parameter "
            "`a`[1] = -0.8 (was 2)");
  EXPECT_EQ(failure_.num_failing_blocks, 1);
  // The blocks keep their values.
  EXPECT_EQ(a[0], 1.0);
  EXPECT_EQ(a[1], 2.0);
  EXPECT_FALSE(Explain(bad, good));
}

// Each kind of failure, at b = 1 and not at b = 0.
TEST_F(DomainFailureTest, Reasons) {
  double b = 0.0;
  problem_.AddParameterBlock(&b, 1);
  double value = 0.0;
  bool result = true;
  Add(
      [&](double const* const* x, double* r) {
        *r = x[0][0] == 1.0 ? value : 0.0;
        return x[0][0] != 1.0 || result;
      },
      {&b});
  const Eigen::VectorXd good = Eigen::VectorXd::Zero(1);
  const Eigen::VectorXd bad = Eigen::VectorXd::Ones(1);
  EXPECT_FALSE(Explain(good, bad));
  const auto reason = [&](double residual, bool returned) {
    value = residual;
    result = returned;
    EXPECT_TRUE(Explain(good, bad)) << residual;
    EXPECT_EQ(failure_.parameters.size(), 1u);
    return failure_.reason;
  };
  EXPECT_EQ(reason(0.0, false), Reason::kReturned);
  EXPECT_EQ(reason(kNaN, true), Reason::kResidual);
  EXPECT_EQ(reason(-kInfinity, true), Reason::kResidual);
  EXPECT_EQ(reason(1e308, true), Reason::kCost);
  EXPECT_EQ(failure_.ToText(),
            "residual block 0 (the cost is not finite): parameter `block "
            "0`[0] = 1 (was 0)");
  // The largest residual whose square is finite.
  value = std::sqrt(std::numeric_limits<double>::max()) * (1.0 - 1e-15);
  EXPECT_FALSE(Explain(good, bad));
  // r is finite, J is not.
  ceres::Problem root;
  root.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Root, 1, 1>(new Root), nullptr, &b);
  ASSERT_TRUE(
      ExplainDomainFailure({}, ReadStructure(root, {}), bad, good, &failure_));
  EXPECT_EQ(failure_.reason, Reason::kJacobian);
}

// |r|^2 is not finite, but the robust loss of it is: inside the domain.
TEST_F(DomainFailureTest, RobustLoss) {
  double b = 0.0;
  problem_.AddResidualBlock(new Any({1},
                                    [](double const* const* x, double* r) {
                                      *r = 1e308 * x[0][0];
                                      return true;
                                    }),
                            new ceres::TukeyLoss(1.0),
                            &b);
  EXPECT_FALSE(Explain(Eigen::VectorXd::Zero(1), Eigen::VectorXd::Ones(1)));
}

// x y > 1 needs both; either one's return suffices. x + y < 0 by y alone.
TEST_F(DomainFailureTest, OneOfSeveral) {
  double x[1], y[1];
  problem_.AddParameterBlock(x, 1);
  problem_.AddParameterBlock(y, 1);
  Add(
      [](double const* const* p, double* r) {
        *r = 0.0;
        return p[0][0] * p[1][0] <= 1.0;
      },
      {x, y});
  ASSERT_TRUE(Explain(Eigen::Vector2d(0.5, 0.5), Eigen::Vector2d(1.5, 3.0)));
  // y alone leads outside: 0.5 * 3 > 1; x alone does not: 1.5 * 0.5 < 1.
  ASSERT_EQ(failure_.parameters.size(), 1u);
  EXPECT_EQ(failure_.parameters[0].block, 1);
  ASSERT_TRUE(Explain(Eigen::Vector2d(0.5, 0.5), Eigen::Vector2d(1.5, 1.5)));
  ASSERT_EQ(failure_.parameters.size(), 1u);
  EXPECT_EQ(failure_.parameters[0].block, 0);
}

// Two of four components are outside by themselves.
TEST_F(DomainFailureTest, SmallestSet) {
  double x[4];
  problem_.AddParameterBlock(x, 4);
  Add(
      [](double const* const* p, double* r) {
        *r = std::sqrt(p[0][1]) + std::sqrt(p[0][3]);
        return true;
      },
      {x});
  ASSERT_TRUE(Explain(Eigen::Vector4d(1.0, 1.0, 1.0, 1.0),
                      Eigen::Vector4d(-1.0, -2.0, -3.0, -4.0)));
  ASSERT_EQ(failure_.parameters.size(), 2u);
  EXPECT_EQ(failure_.ToText(),
            "residual block 0 (a residual is not finite): parameter `block "
            "0`[1] = -2 (was 1), `block 0`[3] = -4 (was 1)");
}

// Cost functions that return false for jacobians = nullptr: every candidate
// fails, and Ceres reports a cost of 1.8e308.
class NeedsJacobians final : public ceres::SizedCostFunction<1, 1> {
 public:
  bool Evaluate(double const* const* x, double* r, double** J) const override {
    r[0] = 10.0 - x[0][0];
    if (J == nullptr || J[0] == nullptr) return false;
    J[0][0] = -1.0;
    return true;
  }
};

TEST_F(DomainFailureTest, CostFunctionsWithoutResidualsAlone) {
  double x = 0.5;
  problem_.AddResidualBlock(new NeedsJacobians, nullptr, &x);
  ceres::Solver::Options solver = SolverOptions(nullptr);
  ASSERT_TRUE(ExplainNextStep(
      solver, {}, ReadStructure(problem_, {}), problem_, &failure_));
  EXPECT_TRUE(failure_.fails_at_good_state);
  EXPECT_TRUE(failure_.only_without_jacobians);
  EXPECT_EQ(failure_.ToText(),
            "residual block 0 (cost function returned false): the good state "
            "lies outside, too, if no Jacobians are requested (jacobians = "
            "nullptr)");
  EXPECT_EQ(x, 0.5);
}

TEST_F(DomainFailureTest, TheStart) {
  double a[2] = {-1.0, 0.0};
  problem_.AddResidualBlock(NewLog(1.0, 0.0, true), nullptr, a);
  const ProblemStructure structure = ReadStructure(problem_, {});
  ASSERT_TRUE(ExplainDomainFailure(
      {}, structure, structure.State(), structure.State(), &failure_));
  EXPECT_TRUE(failure_.fails_at_good_state);
  EXPECT_FALSE(failure_.only_without_jacobians);
  EXPECT_TRUE(failure_.parameters.empty());
}

// A Gauss-Newton step for log(b) = -2 from b = 4 leads to 4 (1 - 2 - log 4).
TEST_F(DomainFailureTest, FirstStepOfCeres) {
  double a[2] = {4.0, 0.0};
  for (const bool returns_false : {true, false}) {
    for (const auto strategy : {ceres::LEVENBERG_MARQUARDT, ceres::DOGLEG}) {
      ceres::Problem problem;
      problem.AddResidualBlock(
          NewLog(0.0, -2.0, returns_false), new ceres::HuberLoss(10.0), a);
      problem.SetManifold(a, new ceres::SubsetManifold(2, {1}));
      ceres::Solver::Options solver = SolverOptions(nullptr);
      solver.trust_region_strategy_type = strategy;
      ASSERT_TRUE(ExplainNextStep(
          solver, {}, ReadStructure(problem, {}), problem, &failure_));
      EXPECT_EQ(failure_.reason,
                returns_false ? Reason::kReturned : Reason::kResidual);
      ASSERT_EQ(failure_.parameters.size(), 1u);
      EXPECT_EQ(failure_.parameters[0].component, 0);
      EXPECT_EQ(failure_.parameters[0].was, 4.0);
      // Damping by 1e-4 of J^T J shortens the step.
      EXPECT_NEAR(failure_.parameters[0].value,
                  4.0 * (1.0 - 2.0 - std::log(4.0)),
                  1e-2);
      EXPECT_EQ(a[0], 4.0);
    }
  }
  ceres::Solver::Options solver = SolverOptions(nullptr);
  solver.minimizer_type = ceres::LINE_SEARCH;
  EXPECT_FALSE(ExplainNextStep(
      solver, {}, ReadStructure(problem_, {}), problem_, &failure_));
}

TEST_F(DomainFailureTest, NoFailure) {
  double x = 0.5;
  problem_.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Offset, 1, 1>(new Offset), nullptr, &x);
  EXPECT_FALSE(ExplainNextStep(SolverOptions(nullptr),
                               {},
                               ReadStructure(problem_, {}),
                               problem_,
                               &failure_));
  EXPECT_EQ(x, 0.5);
}

// The real line below 2.
class Below2 final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 1; }
  int TangentSize() const override { return 1; }
  bool Plus(const double* x,
            const double* delta,
            double* x_plus_delta) const override {
    x_plus_delta[0] = x[0] + delta[0];
    return x_plus_delta[0] < 2.0;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    jacobian[0] = 1.0;
    return true;
  }
  bool Minus(const double* y,
             const double* x,
             double* difference) const override {
    difference[0] = y[0] - x[0];
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    jacobian[0] = 1.0;
    return true;
  }
};

// r = (x - 10) / 10, so that x minus the gradient stays below 2.
struct Tenth {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = 0.1 * (x[0] - 10.0);
    return true;
  }
};

struct LogPlusFour {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    using std::log;
    r[0] = log(x[0]) + 4.0;
    return true;
  }
};

// From 1 the step of Gauss-Newton is -4 for both; one stops at its bound.
TEST_F(DomainFailureTest, AParameterAtItsBoundIsNotTheReason) {
  double a = 1.0, b = 1.0;
  for (double* x : {&a, &b}) {
    problem_.AddResidualBlock(
        new ceres::AutoDiffCostFunction<LogPlusFour, 1, 1>(new LogPlusFour),
        nullptr,
        x);
  }
  problem_.SetParameterLowerBound(&a, 0, 1e-3);
  ASSERT_TRUE(ExplainNextStep(SolverOptions(nullptr),
                              {},
                              ReadStructure(problem_, {}),
                              problem_,
                              &failure_));
  EXPECT_EQ(failure_.residual_block, 1);
  EXPECT_EQ(failure_.num_failing_blocks, 1);
  ASSERT_EQ(failure_.parameters.size(), 1u);
  EXPECT_EQ(failure_.parameters[0].block, 1);
}

TEST_F(DomainFailureTest, FailingPlus) {
  double x = 0.5, y = 0.0;
  problem_.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Offset, 1, 1>(new Offset), nullptr, &y);
  problem_.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Tenth, 1, 1>(new Tenth), nullptr, &x);
  problem_.SetManifold(&x, new Below2);
  constexpr char kText[] = "parameter `block 1` (Plus returned false)";
  const ProblemStructure structure = ReadStructure(problem_, {});
  const Bounds none(problem_, structure);
  ASSERT_TRUE(ExplainFailingStep(
      {}, structure, none, Eigen::Vector2d(0.1, 1.5), &failure_));
  EXPECT_EQ(failure_.ToText(), kText);
  EXPECT_FALSE(ExplainFailingStep(
      {}, structure, none, Eigen::Vector2d(0.1, 1.4), &failure_));
  ASSERT_TRUE(ExplainNextStep(SolverOptions(nullptr),
                              {},
                              ReadStructure(problem_, {}),
                              problem_,
                              &failure_));
  EXPECT_EQ(failure_.ToText(), kText);
}

// Cost functions that use what the callback prepares.
class Preparation final : public ceres::EvaluationCallback {
 public:
  explicit Preparation(const double* x) : x_(x) {}
  void PrepareForEvaluation(bool, bool) override { value = x_[0]; }
  double value = 0.0;

 private:
  const double* x_;
};

TEST_F(DomainFailureTest, EvaluationCallback) {
  double x[2] = {1.0, 1.0};
  Preparation preparation(x);
  ceres::Problem::Options problem_options;
  problem_options.evaluation_callback = &preparation;
  ceres::Problem problem(problem_options);
  problem.AddResidualBlock(new Any({2},
                                   [&](double const* const*, double* r) {
                                     *r = preparation.value;
                                     return preparation.value >= 0.0;
                                   }),
                           nullptr,
                           x);
  options_.evaluation_callback = &preparation;
  ASSERT_TRUE(ExplainDomainFailure(options_,
                                   ReadStructure(problem, {}),
                                   Eigen::Vector2d(1.0, 1.0),
                                   Eigen::Vector2d(-1.0, -1.0),
                                   &failure_));
  ASSERT_EQ(failure_.parameters.size(), 1u);
  EXPECT_EQ(failure_.parameters[0].component, 0);
}

// Random problems in which residual blocks leave their domain, x[c] >= 0 for one
// or two components c of their arguments.
TEST(DomainFailure, NamesWhatLeftInRandomProblems) {
  for (int seed = 0; seed < 1000; ++seed) {
    std::mt19937 random(seed);
    const auto below = [&random](int n) {
      return static_cast<int>(random() % static_cast<unsigned>(n));
    };
    const int num_blocks = 1 + below(6);
    std::vector<std::vector<double>> blocks(num_blocks);
    ceres::Problem problem;
    for (auto& block : blocks) {
      block.assign(1 + below(4), 1.0);
      problem.AddParameterBlock(block.data(), static_cast<int>(block.size()));
      if (block.size() > 1 && below(3) == 0) {
        problem.SetManifold(
            block.data(),
            new ceres::SubsetManifold(static_cast<int>(block.size()),
                                      {below(static_cast<int>(block.size()))}));
      }
    }
    // What each residual block needs: components of parameter blocks.
    struct Need {
      int block, component;
    };
    std::vector<std::vector<Need>> needs;
    const int num_residual_blocks = 1 + below(8);
    for (int k = 0; k < num_residual_blocks; ++k) {
      std::vector<double*> arguments;
      std::vector<int> sizes;
      std::vector<Need>& need = needs.emplace_back();
      std::vector<std::pair<int, int>> tested;  // argument, component
      const int first = below(num_blocks);
      const int num_arguments = 1 + below(std::min(num_blocks, 3));
      for (int b = 0; b < num_arguments; ++b) {
        const int block = (first + b) % num_blocks;
        arguments.push_back(blocks[block].data());
        sizes.push_back(static_cast<int>(blocks[block].size()));
        if (b > 1) continue;
        const int component = below(sizes.back());
        need.push_back({block, component});
        tested.emplace_back(b, component);
      }
      const int kind = below(4);
      problem.AddResidualBlock(
          new Any(sizes,
                  [tested, kind](double const* const* x, double* r) {
                    *r = 0.5;
                    for (const auto& [b, c] : tested) {
                      if (x[b][c] >= 0.0) continue;
                      if (kind == 0) return false;
                      *r = kind == 1 ? kNaN : kind == 2 ? kInfinity : 1e308;
                    }
                    return true;
                  }),
          nullptr,
          arguments);
    }
    const ProblemStructure structure = ReadStructure(problem, {});
    Eigen::VectorXd bad(structure.num_ambient);
    for (Eigen::Index i = 0; i < bad.size(); ++i) {
      bad[i] = below(4) == 0 ? -1.0 : below(2) == 0 ? 1.0 : 2.0;
    }
    const auto offset_of = [&](const Need& need) {
      for (const auto& block : structure.parameter_blocks) {
        if (block.values == blocks[need.block].data()) {
          return block.offset + need.component;
        }
      }
      return -1;
    };
    int first_failing = -1;
    int num_failing = 0;
    std::vector<int> expected;  // offsets
    for (int k = 0; k < num_residual_blocks; ++k) {
      std::vector<int> negative;
      for (const Need& need : needs[k]) {
        const int offset = offset_of(need);
        if (bad[offset] < 0.0) negative.push_back(offset);
      }
      if (negative.empty() || num_failing++ > 0) continue;
      first_failing = k;
      expected = negative;
    }
    DomainFailure failure;
    const Eigen::VectorXd good = Eigen::VectorXd::Ones(structure.num_ambient);
    ASSERT_EQ(ExplainDomainFailure({}, structure, good, bad, &failure),
              num_failing > 0)
        << seed;
    if (num_failing == 0) continue;
    EXPECT_EQ(failure.residual_block, first_failing) << seed;
    EXPECT_EQ(failure.num_failing_blocks, num_failing) << seed;
    std::vector<int> named;
    for (const DomainFailure::Parameter& parameter : failure.parameters) {
      named.push_back(structure.parameter_blocks[parameter.block].offset +
                      parameter.component);
      EXPECT_EQ(parameter.value, -1.0);
      EXPECT_EQ(parameter.was, 1.0);
    }
    EXPECT_EQ(named, expected) << seed;
    for (const auto& block : blocks) {
      for (const double value : block) EXPECT_EQ(value, 1.0);
    }
  }
}

// The rule has the first turn. Then Ceres' first step leaves the domain, and the
// rule has the next turn, too.
TEST(UpdateCallback, ProposesAfterCeresLeftTheDomain) {
  for (const bool returns_false : {true, false}) {
    double a[2] = {4.0, 0.0};
    ceres::Problem problem;
    problem.AddResidualBlock(NewLog(0.0, -2.0, returns_false), nullptr, a);
    problem.SetManifold(a, new ceres::SubsetManifold(2, {1}));
    // Half of a Gauss-Newton step in log b: a quarter of the cost remains.
    FunctionRule rule([&](const auto&, auto* step, std::string*) {
      const double b = a[0];
      *step = Eigen::VectorXd::Constant(
          1, b * (std::exp(0.5 * (-2.0 - std::log(b))) - 1.0));
      return true;
    });
    UpdateCallback::Options options;
    options.compare_with_plain = false;
    options.max_relative_work = kInfinity;
    options.block_name = [](const double*) { return "b"; };
    UpdateCallback callback(&rule, &problem, options);
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(&callback), &problem, &summary);
    EXPECT_NEAR(a[0], std::exp(-2.0), 1e-6);
    ASSERT_GT(summary.iterations.size(), 3u);
    EXPECT_TRUE(IsOutsideDomain(summary.iterations[2]));
    EXPECT_TRUE(summary.iterations[3].step_is_successful);
    EXPECT_NEAR(
        summary.iterations[3].cost, summary.iterations[1].cost / 4.0, 1e-9);
    const UpdateCallback::Summary counts = callback.summary();
    int num_outside = 0;
    for (const auto& iteration : summary.iterations) {
      num_outside += IsOutsideDomain(iteration);
    }
    EXPECT_EQ(counts.num_outside_domain, num_outside);
    ASSERT_TRUE(counts.first_outside_domain.has_value());
    const DomainFailure& failure = *counts.first_outside_domain;
    ASSERT_EQ(failure.parameters.size(), 1u);
    EXPECT_EQ(failure.parameters[0].name, "b");
    EXPECT_LT(failure.parameters[0].value, 0.0);
    // Of the first proposal.
    EXPECT_NEAR(failure.parameters[0].was, 2.0 * std::exp(-1.0), 1e-9);
    EXPECT_NE(counts.BriefReport().find("; " + std::to_string(num_outside) +
                                        " outside the domain: residual block 0 "
                                        "("),
              std::string::npos)
        << counts.BriefReport();
  }
}

// The candidates of a proposal are counted and explained.
TEST(UpdateCallback, CountsProposalsOutsideTheDomain) {
  double x = 0.5;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Tenth, 1, 1>(new Tenth), nullptr, &x);
  problem.SetManifold(&x, new Below2);
  int num_asked = 0;
  FunctionRule rule([&](const auto&, auto* step, std::string* error) {
    *error = "once";
    *step = Eigen::VectorXd::Constant(1, 4.0);
    return ++num_asked == 1;
  });
  UpdateCallback::Options options;
  options.compare_with_plain = false;
  UpdateCallback callback(&rule, &problem, options);
  ceres::Solver::Options solver = SolverOptions(&callback);
  solver.max_num_iterations = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  // Steps of 4 and 2 fail, and 1 is proposed.
  const UpdateCallback::Summary counts = callback.summary();
  EXPECT_EQ(counts.num_withheld, 2);
  EXPECT_EQ(counts.num_outside_domain, 2);
  ASSERT_TRUE(counts.first_outside_domain.has_value());
  EXPECT_EQ(counts.first_outside_domain->ToText(),
            "parameter `block 0` (Plus returned false)");
  EXPECT_EQ(counts.num_accepted, 1);
  EXPECT_EQ(x, 1.5);
}

}  // namespace domain_failure_test
}  // namespace invgrad
