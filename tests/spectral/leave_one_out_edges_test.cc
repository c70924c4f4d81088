// Leaving out samples where there is little to learn from the others, and what
// is refused.
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/spectral/leave_one_out.h"
#include "tests/spectral/refit.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace leave_one_out_edges_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Two parameters see two samples each; the fifth sample is a copy of the first.
TEST(LeaveOneOutEdges,
     RankDeficientJacobianIsJudgedByTheSmallestResolvedShift) {
  MatrixXd J = RandomMatrices(7).WithSpectrum(8, 20, LogUniform(8, 0.3));
  J.row(4) = J.row(0);
  J.row(5) = J.row(1) - J.row(2);
  const VectorXd g = RandomMatrix(8, 1, 8);
  const std::vector<int> rows = {1, 2, 1, 1, 1, 2};
  for (const double kappa : {0.0, 0.5, 1.0}) {
    LeaveOneOutSummary summary;
    const VectorXd c = ChangeOf(J, g, rows, Damped(kappa, 0.0), &summary);
    EXPECT_EQ(summary.message.rfind("damping raised to ", 0), 0u)
        << summary.message;
    // The raised shift is sqrt(6e-15 cond) and changes c by that over l_min.
    EXPECT_GT(summary.damping, 0.0);
    EXPECT_LT(summary.damping, 1e-6);
    EXPECT_LE(
        RelativeDistance(c, RefitOf(J, g, rows, Damped(kappa, 0.0)).Changes()),
        1e-4)
        << kappa;
    // With damping it is a filter like any other.
    EXPECT_LE(
        RelativeDistance(ChangeOf(J, g, rows, Damped(kappa, 1e-3), &summary),
                         RefitOf(J, g, rows, Damped(kappa, 1e-3)).Changes()),
        1e-7)
        << kappa;
    EXPECT_EQ(summary.message, "");
  }
}

TEST(LeaveOneOutEdges, ChangesFollowTheUnitsOfJ) {
  const SampleBatch& batch = kSampleBatches[5];
  const MatrixXd J = JacobianOf(batch, 17);
  const VectorXd g = RandomMatrix(18, 1, 18);
  for (const double kappa : {-1.0, 0.5, 1.0}) {
    const SpectralFilter filter = Damped(kappa, 1e-3);
    LeaveOneOutSummary summary;
    const VectorXd c = ChangeOf(J, g, batch.rows, filter, &summary);
    for (const double scale : {1e-100, 1e100}) {
      const VectorXd scaled =
          ChangeOf(scale * J, g, batch.rows, filter, &summary);
      EXPECT_LE(RelativeDistance(scaled / std::pow(scale, 1.0 - kappa), c),
                1e-7)
          << scale << " " << kappa;
    }
  }
}

TEST(LeaveOneOutEdges, OneSampleAloneLearnsNothingFromOthers) {
  for (const int n : {9, 2}) {
    const MatrixXd J = RandomMatrix(4, n, 19);
    const VectorXd g = RandomMatrix(4, 1, 20);
    for (const double kappa : {-1.0, 0.5, 1.0}) {
      LeaveOneOutSummary summary;
      EXPECT_EQ(ChangeOf(J, g, {4}, Damped(kappa, 1e-3), &summary),
                VectorXd::Zero(4));
      EXPECT_EQ(summary.score.StepSize(), 0.0);
      EXPECT_EQ(summary.score.RelativeDecrease(), 0.0);
      EXPECT_EQ(summary.score.Generalization(), 0.0);
    }
  }
}

// Each sample has two parameters of its own: the others say nothing about it.
TEST(LeaveOneOutEdges, SamplesThatShareNoParameterChangeNothing) {
  for (const int rows : {1, 3}) {  // m < n and m > n
    MatrixXd J = MatrixXd::Zero(5 * rows, 10);
    for (int i = 0; i < 5; ++i) {
      J.block(rows * i, 2 * i, rows, 2) = RandomMatrix(rows, 2, 21 + i);
    }
    const VectorXd g = RandomMatrix(5 * rows, 1, 30);
    for (const double kappa : {-1.0, 0.5, 1.0}) {
      LeaveOneOutSummary summary;
      const VectorXd c = ChangeOf(
          J, g, std::vector<int>(5, rows), Damped(kappa, 1e-3), &summary);
      EXPECT_LE(c.norm(), 1e-9 * g.norm()) << rows << " " << kappa;
    }
  }
}

// One row for all: what B - 1 copies do to one more is what they do to
// themselves, g (B - 1) s^2 / ((B - 1) s^2 + lambda) for Gauss-Newton.
TEST(LeaveOneOutEdges, EqualSamplesPredictEachOther) {
  for (const int n : {20, 3}) {
    const MatrixXd J = VectorXd::Ones(6) * RandomMatrix(1, n, 31);
    const VectorXd g = VectorXd::Constant(6, 2.0);
    const double squared = J.row(0).squaredNorm();
    SpectralFilter filter = SpectralFilter::LevenbergMarquardt(0.3, 0.0);
    LeaveOneOutSummary summary;
    const VectorXd c = ChangeOf(J, g, std::vector<int>(6, 1), filter, &summary);
    const double expected = 2.0 * 5.0 * squared / (5.0 * squared + 0.3);
    EXPECT_LE((c.array() - expected).abs().maxCoeff(), 1e-10);
    EXPECT_NEAR(summary.score.RelativeDecrease(), 1.0, 1e-12);
    for (const double kappa : {-1.0, 0.0, 0.5, 1.0}) {
      const VectorXd undamped =
          ChangeOf(J, g, std::vector<int>(6, 1), Damped(kappa, 0.0), &summary);
      EXPECT_TRUE(undamped.allFinite());
      EXPECT_GT(undamped.minCoeff(), 0.0);
    }
  }
}

TEST(LeaveOneOutEdges, ZeroResidualOrJacobianGiveZero) {
  for (const int n : {9, 2}) {
    const MatrixXd J = RandomMatrix(6, n, 32);
    const std::vector<int> rows = {2, 2, 2};
    for (const double kappa : {-1.0, 0.5, 1.0}) {
      LeaveOneOutSummary summary;
      EXPECT_EQ(
          ChangeOf(J, VectorXd::Zero(6), rows, Damped(kappa, 0.0), &summary),
          VectorXd::Zero(6));
      EXPECT_EQ(summary.score.StepSize(), 0.0);
      EXPECT_EQ(summary.score.RelativeDecrease(), 0.0);
      EXPECT_EQ(summary.score.Generalization(), 0.0);
      EXPECT_EQ(ChangeOf(MatrixXd::Zero(6, n),
                         VectorXd::Ones(6),
                         rows,
                         Damped(kappa, 0.0),
                         &summary),
                VectorXd::Zero(6));
      EXPECT_EQ(summary.score.g_g, 6.0);
    }
  }
}

TEST(LeaveOneOutEdges, RefusesWhatIsNotFinite) {
  for (const int n : {9, 2}) {
    const MatrixXd J = RandomMatrix(6, n, 33);
    const VectorXd g = RandomMatrix(6, 1, 34);
    LeaveOneOut leave_one_out;
    const auto message_of = [&](const MatrixXd& J_, const VectorXd& g_) {
      std::string message;
      EXPECT_FALSE(leave_one_out.Factorize(
          DenseJacobian(J_), g_, {2, 2, 2}, {}, &message));
      return message;
    };
    VectorXd bad_g = g;
    bad_g[3] = kNaN;
    EXPECT_EQ(message_of(J, bad_g), "g is not finite: row 3 is nan");
    MatrixXd bad_J = J;
    bad_J(4, 1) = kNaN;
    EXPECT_EQ(message_of(bad_J, g), "J is not finite: row 4");
    EXPECT_EQ(message_of(1e200 * J, g), "the squares of J's entries overflow");
    EXPECT_EQ(message_of(1e-200 * J, g),
              "the squares of J's entries underflow");
    LeaveOneOutOptions options;
    options.memory_limit = 10.0;
    std::string message;
    EXPECT_FALSE(leave_one_out.Factorize(
        DenseJacobian(J), g, {2, 2, 2}, options, &message));
    EXPECT_EQ(message.rfind("leaving out samples with J 6 x ", 0), 0u)
        << message;
  }
}

TEST(LeaveOneOutEdgesDeathTest, CallerBugsAreChecked) {
  // OpenBLAS has threads of its own.
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const MatrixXd J = MatrixXd::Identity(2, 3);
  const VectorXd g = VectorXd::Ones(2);
  const SpectralFilter filter;
  LeaveOneOutSummary summary;
  EXPECT_DEATH(ChangeOf(J, g, {1, 2}, filter, &summary), "rows are those of J");
  EXPECT_DEATH(ChangeOf(J, g, {2, 0}, filter, &summary), "at least one row");
  EXPECT_DEATH(ChangeOf(J, VectorXd::Ones(3), {1, 1}, filter, &summary),
               "g.size");
  EXPECT_DEATH(
      ChangeOf(J, g, {1, 1}, SpectralFilter::Power(3.0, 0.0), &summary),
      "kappa=3 is out of range");
  SpectralFilter wiener;
  wiener.noise = 0.1;
  EXPECT_DEATH(ChangeOf(J, g, {1, 1}, wiener, &summary), "Wiener factor");
  MatrixXd changes;
  std::vector<LeaveOneOutSummary> summaries;
  EXPECT_DEATH(LeaveOneOut().Evaluate({filter}, &changes, &summaries),
               "Factorize comes first");
}

}  // namespace leave_one_out_edges_test
}  // namespace invgrad
