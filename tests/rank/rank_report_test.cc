#include "invgrad/rank/rank_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "Eigen/Geometry"
#include "ceres/autodiff_cost_function.h"
#include "ceres/cost_function.h"
#include "ceres/covariance.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/product_manifold.h"
#include "ceres/rotation.h"
#include "gtest/gtest.h"
#include "invgrad/io/numpy_random.h"

namespace invgrad {
namespace rank_report_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// r = sum_b A_b x_b: a Jacobian of any entries.
class Linear final : public ceres::CostFunction {
 public:
  explicit Linear(std::vector<MatrixXd> A) : A_(std::move(A)) {
    set_num_residuals(static_cast<int>(A_[0].rows()));
    for (const MatrixXd& A_b : A_) {
      mutable_parameter_block_sizes()->push_back(static_cast<int>(A_b.cols()));
    }
  }

  bool Evaluate(double const* const* x,
                double* r,
                double** jacobians) const override {
    Eigen::Map<VectorXd> residuals(r, num_residuals());
    residuals.setZero();
    for (std::size_t b = 0; b < A_.size(); ++b) {
      residuals += A_[b] * Eigen::Map<const VectorXd>(x[b], A_[b].cols());
      if (jacobians != nullptr && jacobians[b] != nullptr) {
        Eigen::Map<Eigen::Matrix<double,
                                 Eigen::Dynamic,
                                 Eigen::Dynamic,
                                 Eigen::RowMajor>>(
            jacobians[b], A_[b].rows(), A_[b].cols()) = A_[b];
      }
    }
    return true;
  }

 private:
  const std::vector<MatrixXd> A_;
};

MatrixXd Row(std::initializer_list<double> entries) {
  MatrixXd row(1, entries.size());
  std::copy(entries.begin(), entries.end(), row.data());
  return row;
}

RankReport Report(const ceres::Problem& problem,
                  const RankReport::Options& options = {}) {
  RankReport report;
  std::string error;
  EXPECT_TRUE(ComputeRankReport(options, problem, &report, &error)) << error;
  return report;
}

// Every undetermined direction is one, at least to the threshold, and they are
// independent: the vectors, with columns scaled, have full rank.
void ExpectConsistent(const ceres::Problem& problem, const RankReport& report) {
  int num_unused = 0;
  for (const auto& unused : report.unused) {
    num_unused += static_cast<int>(unused.tangent.size());
  }
  EXPECT_EQ(report.num_undetermined(),
            num_unused + static_cast<int>(report.undetermined.size()));
  MatrixXd steps(report.num_parameters, report.undetermined.size());
  for (std::size_t d = 0; d < report.undetermined.size(); ++d) {
    const RankReport::Direction& direction = report.undetermined[d];
    EXPECT_LE(direction.singular_value, 1e-7);
    double share = 0.0;
    for (const RankReport::Part& part : direction.parts) share += part.share;
    // Parts below 1e-5 are left out.
    EXPECT_NEAR(share, 1.0, 1e-9 * (1.0 + report.blocks.size()));
    steps.col(static_cast<Eigen::Index>(d)) =
        report.Step(direction).normalized();
  }
  if (steps.cols() > 0) {
    EXPECT_EQ(steps.colPivHouseholderQr().rank(), steps.cols());
  }
  EXPECT_EQ(report.blocks.size() + report.num_constant_blocks,
            static_cast<std::size_t>(problem.NumParameterBlocks()));
}

// --- Closed forms ---

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

// r_0 = x + 2 y, r_1 = z: x and y occur only as a sum; z is fine. The two
// groups do not mix.
TEST(RankReport, SumIsToldApartFromTheRest) {
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

TEST(RankReport, DeterminedProblemHasNothingToTell) {
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
    EXPECT_EQ(report.ComponentName(0, 0), "`block 0`[2]");
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

TEST(RankReport, OutliersOfARobustLossSeeNothing) {
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

// --- Poses in the plane ---

// (x, y, angle) of b as a sees it, less a measurement; the angle in units of
// 1 / kAngleUnit radians.
struct Between2 {
  template <typename T>
  bool operator()(const T* a, const T* b, T* r) const {
    using std::cos;
    using std::sin;
    const T dx = b[0] - a[0];
    const T dy = b[1] - a[1];
    const T angle = a[2] / unit;
    r[0] = cos(angle) * dx + sin(angle) * dy - 1.0;
    r[1] = -sin(angle) * dx + cos(angle) * dy - 0.2;
    r[2] = (b[2] - a[2]) / unit - 0.3;
    return true;
  }
  double unit = 1.0;
};

// The same of six blocks of size 1.
struct SplitBetween2 {
  template <typename T>
  bool operator()(const T* xa,
                  const T* ya,
                  const T* ta,
                  const T* xb,
                  const T* yb,
                  const T* tb,
                  T* r) const {
    const T a[3] = {*xa, *ya, *ta};
    const T b[3] = {*xb, *yb, *tb};
    return Between2()(a, b, r);
  }
};

struct Graph2 {
  Graph2(int size, double unit, ceres::Problem* problem) : poses(size) {
    NumpyRandom random(3);
    for (int i = 0; i < size; ++i) {
      poses[i] = {random.Uniform(-5.0, 5.0),
                  random.Uniform(-5.0, 5.0),
                  unit * random.Uniform(-3.0, 3.0)};
    }
    for (int i = 0; i < size; ++i) {
      for (const int j : {i + 1, i + 7}) {
        if (j >= size) continue;
        problem->AddResidualBlock(
            new ceres::AutoDiffCostFunction<Between2, 3, 3, 3>(
                new Between2{unit}),
            nullptr,
            poses[i].data(),
            poses[j].data());
      }
    }
  }
  std::vector<std::array<double, 3>> poses;
};

TEST(RankReport, PoseGraphInThePlaneHasThreeFreedoms) {
  ceres::Problem problem;
  Graph2 graph(40, 1.0, &problem);
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_undetermined(), 3);
  ASSERT_EQ(report.gauges.size(), 1u);
  EXPECT_EQ(report.gauges[0].name, "rigid motion in the plane");
  EXPECT_EQ(report.gauges[0].num_generators, 3);
  EXPECT_EQ(report.undetermined[0].generator, "translation x");
  EXPECT_EQ(report.undetermined[2].generator, "rotation");
  EXPECT_EQ(report.undetermined[2].parts.size(), 40u);
  ASSERT_EQ(report.suggestions.size(), 1u);
  EXPECT_EQ(report.suggestions[0].block, 0);
  EXPECT_TRUE(report.suggestions[0].whole_block);
  EXPECT_EQ(report.suggestions[0].num_removed, 3);

  problem.SetParameterBlockConstant(graph.poses[0].data());
  EXPECT_EQ(Report(problem).num_undetermined(), 0);
}

// The angle in nanoradians: the same conclusions, although J itself has columns
// that differ by a factor of 1e9.
TEST(RankReport, UnitsOfAParameterDoNotMatter) {
  ceres::Problem problem;
  ceres::Problem scaled_problem;
  Graph2 graph(20, 1.0, &problem);
  Graph2 scaled_graph(20, 1e9, &scaled_problem);
  const RankReport report = Report(problem);
  const RankReport scaled = Report(scaled_problem);
  EXPECT_EQ(scaled.num_undetermined(), 3);
  // The same matrix but for rounding.
  EXPECT_LE((report.singular_values - scaled.singular_values)
                .lpNorm<Eigen::Infinity>(),
            1e-12);
  // What ceres::Covariance does not see.
  EXPECT_GT((scaled.unscaled_singular_values.array() <= 1e-7).count(), 3);
  // Only names of rotations in other units are lost: the built-in gauge takes
  // angles for radians.
  EXPECT_EQ(scaled.undetermined.size(), 3u);
}

TEST(RankReport, CovarianceIsDeficientWhereTheReportSaysSo) {
  for (const bool anchored : {false, true}) {
    ceres::Problem problem;
    Graph2 graph(10, 1.0, &problem);
    if (anchored) problem.SetParameterBlockConstant(graph.poses[0].data());
    const RankReport report = Report(problem);
    ceres::Covariance::Options options;
    options.algorithm_type = ceres::DENSE_SVD;
    ceres::Covariance covariance(options);
    const double* last = graph.poses[9].data();
    const bool works = covariance.Compute(
        std::vector<std::pair<const double*, const double*>>{{last, last}},
        &problem);
    EXPECT_EQ(works, anchored);
    EXPECT_EQ(report.ToText().find("rank deficient") == std::string::npos,
              works);
  }
}

TEST(RankReport, PosesOfThreeBlocksAreRecognised) {
  std::vector<std::array<double, 3>> poses;
  ceres::Problem unused_problem;
  Graph2 graph(9, 1.0, &unused_problem);
  ceres::Problem problem;
  for (int i = 0; i < 9; ++i) {
    for (const int j : {i + 1, i + 2}) {
      if (j >= 9) continue;
      double* a = graph.poses[i].data();
      double* b = graph.poses[j].data();
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<SplitBetween2, 3, 1, 1, 1, 1, 1, 1>(
              new SplitBetween2),
          nullptr,
          a,
          a + 1,
          a + 2,
          b,
          b + 1,
          b + 2);
    }
  }
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_undetermined(), 3);
  ASSERT_EQ(report.gauges.size(), 1u);
  EXPECT_EQ(report.gauges[0].name, "rigid motion in the plane");
  // The heading's block, and two places: one block each.
  int num_removed = 0;
  for (const auto& suggestion : report.suggestions) {
    num_removed += suggestion.num_removed;
  }
  EXPECT_EQ(num_removed, 3);
}

// An anchor so weak that the threshold does not see it leaves the gauge; one
// that it does see leaves weak directions, by the gauge's name.
TEST(RankReport, WeakAnchorIsAWeakGauge) {
  for (const double weight : {1e-9, 1e-5}) {
    SCOPED_TRACE(weight);
    ceres::Problem problem;
    Graph2 graph(6, 1.0, &problem);
    problem.AddResidualBlock(new Linear({weight * MatrixXd::Identity(3, 3)}),
                             nullptr,
                             graph.poses[0].data());
    const RankReport report = Report(problem);
    if (weight < 1e-7) {
      EXPECT_EQ(report.num_undetermined(), 3);
      EXPECT_EQ(report.gauges.size(), 1u);
    } else {
      EXPECT_EQ(report.num_undetermined(), 0);
      ASSERT_EQ(report.weak.size(), 3u);
      for (const auto& direction : report.weak) {
        EXPECT_EQ(direction.gauge, "rigid motion in the plane");
      }
    }
  }
}

TEST(RankReport, TwoGraphsAreTwoGroups) {
  ceres::Problem problem;
  Graph2 first(5, 1.0, &problem);
  Graph2 second(6, 1.0, &problem);
  double bias = 0.0;
  problem.AddParameterBlock(&bias, 1);
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_groups, 2);
  EXPECT_EQ(report.num_undetermined(), 7);
  EXPECT_EQ(report.gauges.size(), 2u);
  ASSERT_EQ(report.suggestions.size(), 2u);
  EXPECT_EQ(report.blocks[report.suggestions[1].block].values,
            second.poses[0].data());
}

// --- Poses in space ---

struct Between3 {
  template <typename T>
  bool operator()(
      const T* pa, const T* qa, const T* pb, const T* qb, T* r) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Vector> a(pa);
    const Eigen::Map<const Vector> b(pb);
    const Eigen::Map<const Eigen::Quaternion<T>> Qa(qa);
    const Eigen::Map<const Eigen::Quaternion<T>> Qb(qb);
    Eigen::Map<Vector>(r + 0) = Qa.conjugate() * (b - a);
    Eigen::Map<Vector>(r + 3) = T(2.0) * (Qa.conjugate() * Qb).vec();
    r[0] -= T(1.0);
    return true;
  }
};

struct Graph3 {
  Graph3(int size, ceres::Problem* problem) : p(size), q(size) {
    NumpyRandom random(5);
    for (int i = 0; i < size; ++i) {
      for (double& entry : p[i]) entry = random.Uniform(-3.0, 3.0);
      // A smooth path, so that no edge turns by half a circle.
      const Eigen::Quaterniond turn(Eigen::AngleAxisd(
          0.3 * i, Eigen::Vector3d(1.0, 0.5, -0.3).normalized()));
      Eigen::Map<Eigen::Vector4d>{q[i].data()} = turn.coeffs();
      problem->AddParameterBlock(
          q[i].data(), 4, new ceres::EigenQuaternionManifold);
    }
    for (int i = 0; i < size; ++i) {
      for (const int j : {i + 1, i + 3}) {
        if (j >= size) continue;
        problem->AddResidualBlock(
            new ceres::AutoDiffCostFunction<Between3, 6, 3, 4, 3, 4>(
                new Between3),
            nullptr,
            p[i].data(),
            q[i].data(),
            p[j].data(),
            q[j].data());
      }
    }
  }
  std::vector<std::array<double, 3>> p;
  std::vector<std::array<double, 4>> q;
};

TEST(RankReport, PoseGraphInSpaceHasSixFreedoms) {
  ceres::Problem problem;
  Graph3 graph(15, &problem);
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_undetermined(), 6);
  ASSERT_EQ(report.gauges.size(), 1u);
  EXPECT_EQ(report.gauges[0].name, "rigid motion in space");
  EXPECT_EQ(report.gauges[0].num_generators, 6);
  EXPECT_EQ(report.undetermined[5].generator, "rotation about z");
  ASSERT_EQ(report.suggestions.size(), 2u);
  EXPECT_TRUE(report.suggestions[0].whole_block);

  problem.SetParameterBlockConstant(graph.p[0].data());
  // The rotation about the first position remains, as combinations.
  const RankReport turned = Report(problem);
  ExpectConsistent(problem, turned);
  EXPECT_EQ(turned.num_undetermined(), 3);
  ASSERT_EQ(turned.gauges.size(), 1u);
  EXPECT_EQ(turned.gauges[0].name, "rigid motion in space");
  EXPECT_TRUE(turned.undetermined[0].generator.empty());
  problem.SetParameterBlockConstant(graph.q[0].data());
  EXPECT_EQ(Report(problem).num_undetermined(), 0);
}

TEST(RankReport, SuggestionsTakeAwayWhatTheySay) {
  ceres::Problem problem;
  Graph3 graph(8, &problem);
  const RankReport before = Report(problem);
  int undetermined = before.num_undetermined();
  for (const RankReport::Suggestion& suggestion : before.suggestions) {
    ASSERT_TRUE(suggestion.whole_block);
    problem.SetParameterBlockConstant(
        const_cast<double*>(before.blocks[suggestion.block].values));
    undetermined -= suggestion.num_removed;
    EXPECT_EQ(Report(problem).num_undetermined(), undetermined);
  }
  EXPECT_EQ(undetermined, 0);
}

// --- Bundle adjustment ---

// BAL's camera: angle axis, translation, focal length, two distortions.
struct Reprojection {
  template <typename T>
  bool operator()(const T* camera, const T* point, T* r) const {
    T p[3];
    ceres::AngleAxisRotatePoint(camera, point, p);
    for (int i = 0; i < 3; ++i) p[i] += camera[3 + i];
    const T u = -p[0] / p[2];
    const T v = -p[1] / p[2];
    const T s = u * u + v * v;
    const T scale = camera[6] * (1.0 + s * (camera[7] + s * camera[8]));
    r[0] = scale * u - 0.1;
    r[1] = scale * v + 0.2;
    return true;
  }
};

// The same with rotation, translation and point as blocks, focal length 1.
struct QuaternionReprojection {
  template <typename T>
  bool operator()(const T* q, const T* t, const T* point, T* r) const {
    T p[3];
    ceres::QuaternionRotatePoint(q, point, p);
    r[0] = (p[0] + t[0]) / (p[2] + t[2]);
    r[1] = (p[1] + t[1]) / (p[2] + t[2]);
    return true;
  }
};

struct Scene {
  Scene(int num_cameras, int num_points)
      : cameras(num_cameras), q(num_cameras), points(num_points) {
    NumpyRandom random(11);
    for (int c = 0; c < num_cameras; ++c) {
      for (int i = 0; i < 3; ++i) {
        cameras[c][i] = random.Uniform(-0.4, 0.4);
        cameras[c][3 + i] = random.Uniform(-1.0, 1.0);
      }
      cameras[c][5] -= 6.0;
      cameras[c][6] = random.Uniform(1.0, 1.5);
      cameras[c][7] = random.Uniform(-0.1, 0.1);
      cameras[c][8] = random.Uniform(-0.1, 0.1);
      ceres::AngleAxisToQuaternion(cameras[c].data(), q[c].data());
    }
    for (auto& point : points) {
      for (double& entry : point) entry = random.Uniform(-2.0, 2.0);
    }
  }

  void AddImages(int camera, int point, ceres::Problem* problem) {
    problem->AddResidualBlock(
        new ceres::AutoDiffCostFunction<Reprojection, 2, 9, 3>(
            new Reprojection),
        nullptr,
        cameras[camera].data(),
        points[point].data());
  }

  void AddAllImages(ceres::Problem* problem) {
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      for (std::size_t p = 0; p < points.size(); ++p) {
        AddImages(static_cast<int>(c), static_cast<int>(p), problem);
      }
    }
  }

  std::vector<std::array<double, 9>> cameras;
  std::vector<std::array<double, 4>> q;
  std::vector<std::array<double, 3>> points;
};

TEST(RankReport, ReconstructionFromImagesHasSevenFreedoms) {
  Scene scene(4, 25);
  ceres::Problem problem;
  scene.AddAllImages(&problem);
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_undetermined(), 7);
  ASSERT_EQ(report.gauges.size(), 1u);
  EXPECT_EQ(report.gauges[0].name, "similarity in space");
  EXPECT_EQ(report.gauges[0].num_generators, 7);
  EXPECT_EQ(report.undetermined[6].generator, "scale");
  // Camera 0's pose, and no intrinsics; then one component.
  ASSERT_GE(report.suggestions.size(), 2u);
  EXPECT_EQ(report.suggestions[0].block, 0);
  EXPECT_EQ(report.suggestions[0].tangent,
            (std::vector<int>{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(report.suggestions[0].num_removed, 6);
  EXPECT_EQ(report.suggestions[1].num_removed, 1);
  EXPECT_EQ(report.suggestions[1].tangent.size(), 1u);

  // The scale about a camera that is held: one combination.
  problem.SetParameterBlockConstant(scene.cameras[0].data());
  const RankReport held = Report(problem);
  EXPECT_EQ(held.num_undetermined(), 1);
  ASSERT_EQ(held.gauges.size(), 1u);
  EXPECT_EQ(held.gauges[0].name, "similarity in space");
  EXPECT_TRUE(held.undetermined[0].generator.empty());
}

TEST(RankReport, RotationAndTranslationInTheirOwnBlocks) {
  Scene scene(4, 20);
  ceres::Problem problem;
  for (std::size_t c = 0; c < scene.cameras.size(); ++c) {
    problem.AddParameterBlock(
        scene.q[c].data(), 4, new ceres::QuaternionManifold);
    for (auto& point : scene.points) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<QuaternionReprojection, 2, 4, 3, 3>(
              new QuaternionReprojection),
          nullptr,
          scene.q[c].data(),
          scene.cameras[c].data() + 3,
          point.data());
    }
  }
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_undetermined(), 7);
  ASSERT_EQ(report.gauges.size(), 1u);
  EXPECT_EQ(report.gauges[0].name, "similarity in space");
}

// A point in one image only: its place along the ray is open, beside the gauge.
TEST(RankReport, PointOfOneImageIsOpenAlongItsRay) {
  Scene scene(4, 25);
  scene.points.push_back({0.3, -0.4, 0.5});
  ceres::Problem problem;
  for (int c = 0; c < 4; ++c) {
    for (int p = 0; p < 25; ++p) scene.AddImages(c, p, &problem);
  }
  scene.AddImages(2, 25, &problem);
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_undetermined(), 8);
  ASSERT_EQ(report.undetermined.size(), 8u);
  const RankReport::Direction& ray = report.undetermined[0];
  ASSERT_EQ(ray.parts.size(), 1u);
  EXPECT_EQ(report.blocks[ray.parts[0].block].values, scene.points[25].data());
  // Camera 2's centre is -R^T t.
  const auto& camera = scene.cameras[2];
  const double inverse[3] = {-camera[0], -camera[1], -camera[2]};
  double center[3];
  ceres::AngleAxisRotatePoint(inverse, camera.data() + 3, center);
  Eigen::Vector3d to_point;
  for (int i = 0; i < 3; ++i) to_point[i] = scene.points[25][i] + center[i];
  const Eigen::Vector3d found = ray.parts[0].motion.head<3>();
  EXPECT_NEAR(
      found.normalized().cross(to_point.normalized()).norm(), 0.0, 1e-9);
  ASSERT_EQ(report.gauges.size(), 1u);
  EXPECT_EQ(report.gauges[0].directions.size(), 7u);
  // One component of the point, and the gauge's.
  int num_removed = 0;
  for (const auto& suggestion : report.suggestions) {
    num_removed += suggestion.num_removed;
  }
  EXPECT_EQ(num_removed, 8);
}

// --- Large problems, gauges of one's own ---

TEST(RankReport, SparseAndDenseWaysAgree) {
  RankReport::Options sparse;
  sparse.max_dense_size = 0;
  for (const bool plane : {true, false}) {
    SCOPED_TRACE(plane);
    ceres::Problem problem;
    std::unique_ptr<Graph2> graph;
    std::unique_ptr<Scene> scene;
    if (plane) {
      graph = std::make_unique<Graph2>(60, 1.0, &problem);
    } else {
      scene = std::make_unique<Scene>(5, 40);
      scene->AddAllImages(&problem);
    }
    const RankReport a = Report(problem);
    const RankReport b = Report(problem, sparse);
    ExpectConsistent(problem, b);
    EXPECT_EQ(a.rank, b.rank);
    EXPECT_FALSE(b.has_all_singular_values);
    EXPECT_TRUE(b.is_complete);
    // Power iteration is good to a percent.
    EXPECT_NEAR(a.s_max, b.s_max, 0.02 * a.s_max);
    ASSERT_EQ(a.gauges.size(), b.gauges.size());
    for (std::size_t g = 0; g < a.gauges.size(); ++g) {
      EXPECT_EQ(a.gauges[g].name, b.gauges[g].name);
      EXPECT_EQ(a.gauges[g].directions, b.gauges[g].directions);
    }
    ASSERT_EQ(a.suggestions.size(), b.suggestions.size());
    for (std::size_t i = 0; i < a.suggestions.size(); ++i) {
      EXPECT_EQ(a.suggestions[i].block, b.suggestions[i].block);
      EXPECT_EQ(a.suggestions[i].tangent, b.suggestions[i].tangent);
    }
    ASSERT_EQ(a.weak.size(), b.weak.size());
    const double ratio = a.s_max / b.s_max;
    for (std::size_t i = 0; i < a.weak.size(); ++i) {
      EXPECT_NEAR(a.weak[i].singular_value * ratio,
                  b.weak[i].singular_value,
                  0.02 * b.weak[i].singular_value);
    }
  }
}

TEST(RankReport, SparseWaySaysWhenThereMayBeMore) {
  // 30 pairs of which only the sums are seen, in one group by one more block.
  std::vector<double> x(60, 1.0);
  double shared = 1.0;
  ceres::Problem problem;
  for (int i = 0; i < 30; ++i) {
    problem.AddResidualBlock(new Linear({Row({1.0}), Row({1.0}), Row({0.1})}),
                             nullptr,
                             &x[2 * i],
                             &x[2 * i + 1],
                             &shared);
  }
  problem.AddResidualBlock(new Linear({Row({1.0})}), nullptr, &shared);
  RankReport::Options options;
  options.max_dense_size = 0;
  options.max_directions = 5;
  const RankReport some = Report(problem, options);
  EXPECT_FALSE(some.is_complete);
  EXPECT_LT(some.num_undetermined(), 30);
  EXPECT_NE(some.ToText().find("max_directions"), std::string::npos);
  options.max_directions = 40;
  const RankReport all = Report(problem, options);
  ExpectConsistent(problem, all);
  EXPECT_TRUE(all.is_complete);
  EXPECT_EQ(all.num_undetermined(), 30);
  for (const auto& direction : all.undetermined) {
    EXPECT_EQ(direction.parts.size(), 2u);
  }
}

TEST(RankReport, TwoRunsAreTheSame) {
  RankReport::Options options;
  options.max_dense_size = 0;
  ceres::Problem problem;
  Graph2 graph(30, 1.0, &problem);
  const RankReport a = Report(problem, options);
  const RankReport b = Report(problem, options);
  EXPECT_EQ(a.ToText(), b.ToText());
  EXPECT_EQ(a.singular_values, b.singular_values);
}

TEST(RankReport, GaugesOfOnesOwnHaveTheirNames) {
  // A clock's offset: every block is a time, and rates do not matter.
  std::vector<std::array<double, 4>> x(5, {1.0, 2.0, 3.0, 4.0});
  ceres::Problem problem;
  MatrixXd A = MatrixXd::Identity(4, 4);
  MatrixXd rest = MatrixXd::Identity(4, 4).bottomRows(3);
  for (int i = 0; i + 1 < 5; ++i) {
    problem.AddResidualBlock(
        new Linear({A, -A}), nullptr, x[i].data(), x[i + 1].data());
  }
  problem.AddResidualBlock(new Linear({rest}), nullptr, x[2].data());
  EXPECT_TRUE(Report(problem).gauges.empty());
  RankReport::Options options;
  Gauge clock;
  clock.name = "offset of all clocks";
  clock.generators = {"offset"};
  clock.motions = [](const GaugeComponent& component, MatrixXd* motions) {
    for (const GaugeBlock& block : component.blocks) {
      if (block.size != 4) return false;
      (*motions)(block.offset, 0) = 1.0;
    }
    return true;
  };
  options.gauges = {clock};
  const RankReport report = Report(problem, options);
  EXPECT_EQ(report.num_undetermined(), 1);
  ASSERT_EQ(report.gauges.size(), 1u);
  EXPECT_EQ(report.gauges[0].name, "offset of all clocks");
  EXPECT_NE(report.ToText().find("gauge freedom: offset of all clocks"),
            std::string::npos);
}

}  // namespace rank_report_test
}  // namespace invgrad
