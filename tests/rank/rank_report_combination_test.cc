// Names of combinations of a gauge's generators, and combinations without one.
#include <array>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/internal/qr.h"
#include "invgrad/rank_report.h"
#include "tests/rank/rank_problems.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace rank_report_combination_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Points in the plane, any subspace of whose motions may be undetermined: the
// others have a residual each.
struct Points {
  explicit Points(int size) : x(size) {
    NumpyRandom random(17);
    for (auto& point : x) {
      for (double& entry : point) entry = random.Uniform(-4.0, 4.0);
    }
  }

  // (x, y) -> a + w (-y, x) + e (x, y)
  VectorXd Motion(double ax, double ay, double w, double e) const {
    VectorXd motion(2 * x.size());
    for (std::size_t i = 0; i < x.size(); ++i) {
      motion[2 * i] = ax - w * x[i][1] + e * x[i][0];
      motion[2 * i + 1] = ay + w * x[i][0] + e * x[i][1];
    }
    return motion;
  }

  RankReport ReportOf(const MatrixXd& undetermined) {
    const Eigen::Index n = undetermined.rows();
    const Eigen::Index k = undetermined.cols();
    MatrixXd padded = RandomMatrix(n, n, 1);
    padded.leftCols(k) = undetermined;
    const MatrixXd A = Orthonormalized(padded).rightCols(n - k).transpose();
    ceres::Problem problem;
    std::vector<MatrixXd> coefficients;
    std::vector<double*> blocks;
    for (std::size_t i = 0; i < x.size(); ++i) {
      coefficients.emplace_back(A.middleCols(2 * static_cast<int>(i), 2));
      blocks.push_back(x[i].data());
    }
    problem.AddResidualBlock(new Linear(coefficients), nullptr, blocks);
    RankReport report = Report(problem);
    ExpectConsistent(problem, report);
    EXPECT_EQ(report.num_undetermined(), k);
    return report;
  }

  std::vector<std::array<double, 2>> x;
};

TEST(GaugeCombinations, ElementsOfTheSimilaritiesOfPoints) {
  Points points(7);
  const auto [x, y] = points.x[5];
  const VectorXd turn = points.Motion(y, -x, 1.0, 0.0);     // about point 5
  const VectorXd growth = points.Motion(-x, -y, 0.0, 1.0);  // the same
  const VectorXd up = points.Motion(0.0, 1.0, 0.0, 0.0);
  const auto both = [](const VectorXd& a, const VectorXd& b) {
    MatrixXd result(a.size(), 2);
    result << a + 0.3 * b, b - a;  // mixed
    return result;
  };
  struct Case {
    MatrixXd undetermined;
    Names names;
  };
  for (const auto& [undetermined, names] :
       {Case{turn, {"rotation about `block 5`"}},
        Case{growth, {"scale about `block 5`"}},
        Case{both(turn, growth),
             {"rotation about `block 5`", "scale about `block 5`"}},
        Case{both(up, growth), {"translation y", "scale about `block 5`"}},
        // A spiral, alone and beside a translation.
        Case{turn + 0.5 * growth, {""}},
        Case{both(up, turn + 0.5 * growth), {"translation y", ""}}}) {
    const RankReport report = points.ReportOf(undetermined);
    ASSERT_EQ(report.undetermined.size(), names.size()) << report.ToText();
    for (std::size_t i = 0; i < names.size(); ++i) {
      EXPECT_EQ(report.undetermined[i].generator, names[i]);
    }
    EXPECT_EQ(report.gauges.size(), 1u);
  }
}

TEST(GaugeCombinations, OtherCombinationsAreNoGauge) {
  for (const int size : {2, 3, 5, 20}) {
    for (const int k : {1, 2, 3}) {
      SCOPED_TRACE(testing::Message() << size << " points, " << k);
      Points points(size);
      NumpyRandom random(100 * size + k);
      MatrixXd undetermined(2 * size, k);
      for (auto column : undetermined.colwise()) {
        for (double& entry : column) entry = random.Uniform(-1.0, 1.0);
      }
      const RankReport report = points.ReportOf(undetermined);
      EXPECT_TRUE(report.gauges.empty()) << report.ToText();
    }
  }
}

// One direction off a rotation by 1e-3 is no rotation.
TEST(GaugeCombinations, NearlyARotationIsNoGauge) {
  Points points(7);
  VectorXd motion = points.Motion(0.2, -0.4, 1.0, 0.0);
  motion[4] += 1e-3;
  EXPECT_TRUE(points.ReportOf(motion).gauges.empty());
}

// y_c = gain_c colour_c
struct ChannelProducts {
  template <typename T>
  bool operator()(const T* gain, const T* colour, T* r) const {
    for (int c = 0; c < 3; ++c) r[c] = gain[c] * colour[c] - 0.5;
    return true;
  }
};

TEST(GaugeCombinations, FactorOfEachChannel) {
  for (const int num_images : {1, 4, 60}) {
    SCOPED_TRACE(num_images);
    NumpyRandom random(23);
    std::vector<std::array<double, 3>> gains(num_images);
    std::vector<std::array<double, 3>> colours(6);
    for (auto* blocks : {&gains, &colours}) {
      for (auto& block : *blocks) {
        for (double& entry : block) entry = random.Uniform(0.5, 2.0);
      }
    }
    ceres::Problem problem;
    for (auto& gain : gains) {
      for (auto& colour : colours) {
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<ChannelProducts, 3, 3, 3>(
                new ChannelProducts),
            nullptr,
            gain.data(),
            colour.data());
      }
    }
    EXPECT_EQ(NamesOf(problem),
              (Names{"factor of component 0",
                     "factor of component 1",
                     "factor of component 2"}));
    AddPrior(Row({0.0, 1.0, 0.0}), gains[0].data(), &problem);
    EXPECT_EQ(NamesOf(problem),
              (Names{"factor of component 0", "factor of component 2"}));
    problem.SetManifold(colours[2].data(), new ceres::SubsetManifold(3, {0}));
    EXPECT_EQ(NamesOf(problem), Names{"factor of component 2"});
  }
}

// A gauge of one's own names what remains of it by itself.
TEST(GaugeCombinations, OnesOwnGaugeNamesThem) {
  std::vector<std::array<double, 4>> x(5, {1.0, 2.0, 3.0, 4.0});
  const MatrixXd I = MatrixXd::Identity(4, 4);
  ceres::Problem problem;
  for (std::size_t i = 0; i + 1 < x.size(); ++i) {
    problem.AddResidualBlock(
        new Linear({I, -I}), nullptr, x[i].data(), x[i + 1].data());
  }
  // Translations with these rows' null vector (1, 2, -1, 0) / 2 remain.
  MatrixXd held(3, 4);
  held << 2.0, -1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0;
  AddPrior(held, x[1].data(), &problem);
  RankReport::Options options;
  Gauge gauge;
  gauge.name = "offsets";
  gauge.generators = {"a", "b", "c", "d"};
  gauge.motions = [](const GaugeComponent& component, MatrixXd* motions) {
    for (const GaugeBlock& block : component.blocks) {
      motions->middleRows(block.offset, 4).setIdentity();
    }
    return true;
  };
  options.gauges = {gauge};
  EXPECT_EQ(NamesOf(problem, options), Names{""});
  VectorXd given;
  options.gauges[0].name_combinations = [&given](const GaugeComponent&,
                                                 const MatrixXd& coefficients) {
    EXPECT_EQ(coefficients.cols(), 1);
    given = coefficients.col(0);
    return std::vector<Gauge::Combination>{
        {"no such motion", VectorXd::Ones(4)}, {"a + 2 b - c", given}};
  };
  // A combination that changes the residuals is not reported.
  EXPECT_EQ(NamesOf(problem, options), Names{"a + 2 b - c"});
  EXPECT_LE((given / given[0] - Eigen::Vector4d(1.0, 2.0, -1.0, 0.0)).norm(),
            1e-12);
}

}  // namespace rank_report_combination_test
}  // namespace invgrad
