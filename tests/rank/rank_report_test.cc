#include "invgrad/rank_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "ceres/loss_function.h"
#include "gtest/gtest.h"
#include "tests/rank/rank_problems.h"

namespace invgrad {
namespace rank_report_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Product {
  template <typename T>
  bool operator()(const T* a, const T* b, T* r) const {
    r[0] = a[0] * b[0] - 5.0;
    return true;
  }
};

TEST(RankReport, ProductLeavesAFactorOpen) {
  double a = 2.0;
  double b = 3.0;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Product, 1, 1, 1>(new Product),
      nullptr,
      &a,
      &b);
  RankReport::Options options;
  options.block_name = [&a](const double* values) {
    return values == &a ? "gain" : "signal";
  };
  const RankReport report = Report(problem, options);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.rank, 1);
  ASSERT_EQ(report.undetermined.size(), 1u);
  // a -> a (1 + e), b -> b (1 - e): (2, -3), the largest entry scaled to 1.
  const VectorXd step = report.Step(report.undetermined[0]);
  EXPECT_NEAR(step[0], -2.0 / 3.0, 1e-14);
  EXPECT_NEAR(step[1], 1.0, 1e-14);
  EXPECT_NEAR(report.undetermined[0].parts[0].share, 0.5, 1e-14);
  ASSERT_EQ(report.gauges.size(), 1u);
  EXPECT_NE(report.gauges[0].name.find("factor between first and second"),
            std::string::npos);
  ASSERT_EQ(report.suggestions.size(), 1u);
  EXPECT_EQ(report.suggestions[0].block, 0);
  EXPECT_EQ(report.suggestions[0].num_removed, 1);
  // The Jacobian is (3, 2), scaled (1, 1): s = sqrt(2), 0.
  EXPECT_NEAR(report.s_max, std::sqrt(2.0), 1e-14);
  EXPECT_NEAR(report.singular_values[0], 0.0, 1e-15);
  EXPECT_EQ(report.singular_values[1], 1.0);
  const std::string text = report.ToText();
  EXPECT_NE(text.find("rank 1 of 2 parameters"), std::string::npos) << text;
  EXPECT_NE(text.find("hold `gain` constant: takes away 1 of 1"),
            std::string::npos)
      << text;
}

// a_1 exp(-b_1 t) + a_2 exp(-b_2 t), x = (a_1, b_1, a_2, b_2).
struct TwoDecays {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    using std::exp;
    for (int i = 0; i < 20; ++i) {
      const double t = 0.2 * i;
      r[i] = x[0] * exp(-x[1] * t) + x[2] * exp(-x[3] * t) - 1.0;
    }
    return true;
  }
};

TEST(RankReport, EqualRatesAreNamed) {
  double x[] = {2.0, 0.5, 1.0, 0.5};  // the amplitudes differ
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<TwoDecays, 20, 4>(new TwoDecays),
      nullptr,
      x);
  RankReport report = Report(problem, RankReport::Options());
  EXPECT_EQ(report.rank, 2);
  ASSERT_EQ(report.equal_parameters.size(), 1u);
  EXPECT_EQ(report.equal_parameters[0].value, 0.5);
  EXPECT_EQ(report.equal_parameters[0].tangents, (std::array<int, 2>{1, 3}));
  EXPECT_NE(report.ToText().find("`block 0`[1] and `block 0`[3] = 0.5"),
            std::string::npos)
      << report.ToText();
  x[3] = 0.7;
  report = Report(problem, RankReport::Options());
  EXPECT_EQ(report.rank, 4);
  EXPECT_TRUE(report.equal_parameters.empty());
}

// r_0 = x + 2 y, r_1 = z: x and y occur only as a sum; z is fine. The two
// groups do not mix.
TEST(RankReport, SumIsSeparateFromTheRest) {
  double x = 1.0;
  double y = -1.0;
  double z = 0.5;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new Linear({Row({1.0}), Row({2.0})}), nullptr, &x, &y);
  problem.AddResidualBlock(new Linear({Row({7.0})}), nullptr, &z);
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.rank, 2);
  EXPECT_EQ(report.num_groups, 2);
  ASSERT_EQ(report.undetermined.size(), 1u);
  const VectorXd step = report.Step(report.undetermined[0]);
  EXPECT_NEAR(step[0], 1.0, 1e-14);
  EXPECT_NEAR(step[1], -0.5, 1e-14);
  EXPECT_EQ(step[2], 0.0);
  EXPECT_NE(report.ToText().find("+1 `block 0` -0.5 `block 1`"),
            std::string::npos)
      << report.ToText();
}

// One linear residual of k scalars leaves k - 1 combinations undetermined, which
// are no gauge, also where x, y and angle of a pose would span all three.
TEST(RankReport, CombinationsOfScalarsAreNoMotions) {
  const double rows[][4] = {
      {1.0, 2.0, 3.0, 4.0}, {1.0, -0.7, 2.0, 0.5}, {5.0, 0.1, 1.0, -2.0}};
  for (const auto& a : rows) {
    for (const int k : {2, 3, 4}) {
      double x[] = {1.0, -1.7, 0.6, 2.3};
      ceres::Problem problem;
      std::vector<MatrixXd> coefficients;
      std::vector<double*> blocks;
      for (int i = 0; i < k; ++i) {
        coefficients.push_back(Row({a[i]}));
        blocks.push_back(&x[i]);
      }
      problem.AddResidualBlock(new Linear(coefficients), nullptr, blocks);
      const RankReport report = Report(problem);
      EXPECT_EQ(report.rank, 1);
      EXPECT_EQ(report.undetermined.size(), k - 1u);
      EXPECT_TRUE(report.gauges.empty()) << report.ToText();
    }
  }
}

TEST(RankReport, UnusedParametersAreExact) {
  double a[3] = {1.0, 2.0, 3.0};
  double lonely[2] = {0.0, 0.0};
  double zero = 1.0;
  ceres::Problem problem;
  problem.AddParameterBlock(lonely, 2);
  MatrixXd A = MatrixXd::Identity(3, 3);
  A.col(1).setZero();
  problem.AddResidualBlock(
      new Linear({A, MatrixXd::Zero(3, 1)}), nullptr, a, &zero);
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.rank, 2);
  EXPECT_TRUE(report.undetermined.empty());
  ASSERT_EQ(report.unused.size(), 3u);
  EXPECT_EQ(report.unused[0].tangent, std::vector<int>{1});
  EXPECT_FALSE(report.unused[0].whole_block);
  EXPECT_TRUE(report.unused[1].whole_block);
  EXPECT_FALSE(report.unused[1].in_no_residual);
  EXPECT_TRUE(report.unused[2].whole_block);
  EXPECT_TRUE(report.unused[2].in_no_residual);
  EXPECT_EQ(report.blocks[report.unused[2].block].values, lonely);
  const std::string text = report.ToText();
  EXPECT_NE(text.find("`block 0`[1]  named by"), std::string::npos) << text;
  EXPECT_NE(text.find("`block 2`  no residual block names it"),
            std::string::npos)
      << text;
}

TEST(RankReport, DeterminedProblemHasNoSuggestions) {
  double a[2] = {1.0, 2.0};
  ceres::Problem problem;
  problem.AddResidualBlock(new Linear({MatrixXd::Identity(2, 2)}), nullptr, a);
  const RankReport report = Report(problem);
  EXPECT_EQ(report.rank, 2);
  EXPECT_TRUE(report.suggestions.empty());
  EXPECT_EQ(report.ToText().find("what to do"), std::string::npos);
}

TEST(RankReport, ProblemsWithoutResidualsOrParametersAreNotSpecial) {
  ceres::Problem problem;
  EXPECT_EQ(Report(problem).num_parameters, 0);
  EXPECT_NE(Report(problem).ToText().find("rank 0 of 0"), std::string::npos);
  double a[2] = {1.0, 2.0};
  problem.AddParameterBlock(a, 2);
  EXPECT_EQ(Report(problem).num_undetermined(), 2);
  problem.SetParameterBlockConstant(a);
  EXPECT_EQ(Report(problem).num_undetermined(), 0);
  EXPECT_EQ(Report(problem).num_constant_blocks, 1);
}

// Columns of length one with the angle 2 t between them have s = sqrt(2) cos t
// and sqrt(2) sin t: s / s_max = tan t. s counts if it is strictly larger.
TEST(RankReport, ThresholdsAreRelativeAndStrict) {
  for (const double t : {3e-8, 3e-6, 3e-2}) {
    SCOPED_TRACE(t);
    MatrixXd A(2, 2);
    A << std::cos(t), std::cos(t), std::sin(t), -std::sin(t);
    double x[2] = {0.0, 0.0};
    ceres::Problem problem;
    problem.AddResidualBlock(new Linear({5.0 * A}), nullptr, x);
    RankReport report = Report(problem);
    EXPECT_NEAR(report.singular_values[0], std::tan(t), 1e-15);
    EXPECT_EQ(report.rank, t < 1e-7 ? 1 : 2);
    ASSERT_EQ(report.weak.size(), t > 1e-7 && t < 1e-4 ? 1u : 0u);
    if (!report.weak.empty()) {
      EXPECT_NEAR(report.weak[0].singular_value, std::tan(t), 1e-15);
      EXPECT_NE(report.ToText().find("weakly determined"), std::string::npos);
    }
    RankReport::Options options;
    options.threshold = report.singular_values[0] * report.s_max / report.s_max;
    options.weak_threshold = std::max(options.threshold, 1e-4);
    EXPECT_EQ(Report(problem, options).rank, 1) << "at the threshold";
    options.threshold *= 1.0 - 1e-6;
    EXPECT_EQ(Report(problem, options).rank, 2) << "just below it";
  }
}

TEST(RankReport, MoreParametersThanResiduals) {
  double a[5] = {1.0, 1.0, 1.0, 1.0, 1.0};
  ceres::Problem problem;
  problem.AddResidualBlock(
      new Linear({Row({1.0, 2.0, 3.0, 4.0, 5.0})}), nullptr, a);
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_undetermined(), 4);
  ASSERT_EQ(report.suggestions.size(), 1u);
  EXPECT_EQ(report.suggestions[0].num_removed, 4);
  EXPECT_EQ(report.suggestions[0].tangent.size(), 4u);
  EXPECT_FALSE(report.suggestions[0].whole_block);
  for (const RankReport::Direction& direction : report.undetermined) {
    // The echelon form: one pivot beside one more component.
    EXPECT_EQ((report.Step(direction).array() != 0.0).count(), 2)
        << report.ToText();
  }
}

TEST(RankReport, DirectionsOfDifferentBlocksComeApart) {
  // One group: a chain of differences ties 12 blocks of size 3 together, in
  // components 0 and 1 and with an anchor; component 2 of block 4 and the
  // difference of components 2 of blocks 7 and 8 are left open.
  std::vector<std::array<double, 3>> x(12, {0.1, 0.2, 0.3});
  ceres::Problem problem;
  MatrixXd first = MatrixXd::Identity(3, 3);
  problem.AddResidualBlock(new Linear({first}), nullptr, x[0].data());
  for (int i = 0; i + 1 < 12; ++i) {
    // Mixed, so that no column is zero by itself.
    MatrixXd A(2, 3);
    A << 1.0, 0.2, 0.0, 0.0, 1.0, 0.0;
    problem.AddResidualBlock(
        new Linear({A, -A}), nullptr, x[i].data(), x[i + 1].data());
    if (i + 1 != 4 && i + 1 != 7 && i + 1 != 8) {
      problem.AddResidualBlock(
          new Linear({Row({0.0, 0.0, 2.0})}), nullptr, x[i + 1].data());
    }
  }
  problem.AddResidualBlock(
      new Linear({Row({0.3, 0.0, 1.0}), Row({0.0, 0.1, 2.0})}),
      nullptr,
      x[7].data(),
      x[8].data());
  problem.AddResidualBlock(
      new Linear({Row({0.0, 1.0, 0.0}), Row({0.0, 0.0, 0.0})}),
      nullptr,
      x[3].data(),
      x[4].data());
  // Block 4: the sum of components 1 and 2 only, beside component 1 from the
  // chain.
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_undetermined(), 2);
  ASSERT_EQ(report.unused.size(), 1u);
  EXPECT_EQ(report.unused[0].block, 4);
  EXPECT_EQ(report.unused[0].tangent, std::vector<int>{2});
  ASSERT_EQ(report.undetermined.size(), 1u);
  const RankReport::Direction& pair = report.undetermined[0];
  ASSERT_EQ(pair.parts.size(), 2u);
  const VectorXd step = report.Step(pair);
  EXPECT_NEAR(step[report.blocks[7].column + 2], 1.0, 1e-12);
  EXPECT_NEAR(step[report.blocks[8].column + 2], -0.5, 1e-12);
  EXPECT_TRUE(pair.gauge.empty());
}

TEST(RankReport, SubsetManifoldsAndConstantBlocksHaveNoColumns) {
  double a[3] = {1.0, 2.0, 3.0};
  double b[3] = {4.0, 5.0, 6.0};
  const auto add = [&](ceres::Problem* problem) {
    problem->AddResidualBlock(
        new Linear({MatrixXd::Identity(3, 3), -MatrixXd::Identity(3, 3)}),
        nullptr,
        a,
        b);
  };
  {
    ceres::Problem problem;
    add(&problem);
    const RankReport report = Report(problem);
    EXPECT_EQ(report.num_undetermined(), 3);
    ASSERT_EQ(report.gauges.size(), 1u);
    EXPECT_EQ(report.gauges[0].name,
              "common translation of the blocks of size 3");
    EXPECT_EQ(report.undetermined[1].generator, "translation of component 1");
  }
  {
    ceres::Problem problem;
    add(&problem);
    problem.SetManifold(a, new ceres::SubsetManifold(3, {0, 1}));
    const RankReport report = Report(problem);
    EXPECT_EQ(report.num_parameters, 4);
    EXPECT_EQ(report.num_undetermined(), 1);
    ASSERT_EQ(report.blocks[0].components, std::vector<int>{2});
    EXPECT_EQ(report.blocks[0].ParameterName(0), "`block 0`[2]");
    ASSERT_EQ(report.gauges.size(), 1u);
  }
  {
    ceres::Problem problem;
    add(&problem);
    problem.SetParameterBlockConstant(a);
    EXPECT_EQ(Report(problem).num_undetermined(), 0);
    EXPECT_EQ(Report(problem).num_constant_blocks, 1);
  }
}

// rho' = 0 beyond s = 1.
class Cut final : public ceres::LossFunction {
 public:
  void Evaluate(double s, double rho[3]) const override {
    rho[0] = std::min(s, 1.0);
    rho[1] = s < 1.0 ? 1.0 : 0.0;
    rho[2] = 0.0;
  }
};

TEST(RankReport, OutliersOfARobustLossDetermineNothing) {
  double x = 0.5;
  double y = 30.0;
  ceres::Problem problem;
  problem.AddResidualBlock(new Linear({Row({1.0})}), nullptr, &x);
  problem.AddResidualBlock(
      new Linear({Row({1.0}), Row({1.0})}), new Cut, &x, &y);
  const RankReport report = Report(problem);
  EXPECT_EQ(report.num_undetermined(), 1);
  ASSERT_EQ(report.unused.size(), 1u);
  EXPECT_EQ(report.unused[0].block, 1);
  RankReport::Options options;
  options.apply_loss_function = false;
  EXPECT_EQ(Report(problem, options).num_undetermined(), 0);
}

struct NotANumber {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    using std::sqrt;
    r[0] = sqrt(x[0]);
    return true;
  }
};

TEST(RankReport, ErrorsNameTheResidualBlockOrTheOption) {
  double x = -1.0;
  double y = 1.0;
  ceres::Problem problem;
  const auto add = [&problem](double* values) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<NotANumber, 1, 1>(new NotANumber),
        nullptr,
        values);
  };
  add(&y);
  add(&x);
  RankReport report;
  report.rank = 77;
  std::string error;
  EXPECT_FALSE(ComputeRankReport({}, problem, &report, &error));
  EXPECT_NE(error.find("residual block 1"), std::string::npos) << error;
  EXPECT_EQ(report.rank, 77) << "output was changed";
  x = 1.0;
  RankReport::Options options;
  options.threshold = 0.0;
  EXPECT_FALSE(ComputeRankReport(options, problem, &report, &error));
  EXPECT_NE(error.find("threshold"), std::string::npos) << error;
  options.threshold = 1e-3;
  EXPECT_FALSE(ComputeRankReport(options, problem, &report, &error));
  EXPECT_NE(error.find("weak_threshold"), std::string::npos) << error;
  options = {};
  options.max_directions = 0;
  EXPECT_FALSE(ComputeRankReport(options, problem, &report, &error));
}

}  // namespace rank_report_test
}  // namespace invgrad
