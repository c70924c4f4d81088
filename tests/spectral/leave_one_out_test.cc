// The changes and the scores against their definitions. Edges:
// leave_one_out_edges_test.cc.
#include "invgrad/spectral/leave_one_out.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/spectral/refit.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace leave_one_out_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST(LeaveOneOut, DampedGaussNewtonEqualsRefitting) {
  for (const SampleBatch& batch : kSampleBatches) {
    SCOPED_TRACE(batch.name);
    const MatrixXd J = 3.0 * JacobianOf(batch, 1);
    const VectorXd g = RandomMatrix(static_cast<int>(J.rows()), 1, 2);
    for (const double damping : {1.0, 1e-2, 1e-4}) {
      for (SpectralFilter filter : {Damped(1.0, damping), Damped(1.0, 0.0)}) {
        if (!filter.IsDamped()) filter.damping = 9.0 * damping;
        LeaveOneOutSummary summary;
        const VectorXd c = ChangeOf(J, g, batch.rows, filter, &summary);
        EXPECT_LE(
            RelativeDistance(c, RefitOf(J, g, batch.rows, filter).Changes()),
            1e-10);
        EXPECT_EQ(summary.num_shifts, 1);
        EXPECT_EQ(summary.quadrature_error, 0.0);
        EXPECT_EQ(summary.message, "");
        EXPECT_NEAR(summary.damping, 9.0 * damping, 1e-12 * 9.0 * damping);
      }
    }
  }
}

TEST(LeaveOneOut, PowersEqualRefittingToTheStatedError) {
  for (const SampleBatch& batch : kSampleBatches) {
    const MatrixXd J = 3.0 * JacobianOf(batch, 3);
    const VectorXd g = RandomMatrix(static_cast<int>(J.rows()), 1, 4);
    for (const double kappa : {-0.99, -0.5, 0.0, 0.5, 0.75}) {
      for (const double tolerance : {1e-4, 1e-8, 1e-11}) {
        for (const double damping : {0.0, 1e-4}) {
          // Of m > n, an undamped filter is raised.
          if (damping == 0.0 && J.cols() < J.rows()) continue;
          SCOPED_TRACE(testing::Message() << batch.name << " " << kappa << " "
                                          << tolerance << " " << damping);
          const SpectralFilter filter = Damped(kappa, damping);
          LeaveOneOutOptions options;
          options.tolerance = tolerance;
          LeaveOneOutSummary summary;
          const VectorXd c =
              ChangeOf(J, g, batch.rows, filter, &summary, options);
          const Refit refit = RefitOf(J, g, batch.rows, filter);
          EXPECT_EQ(summary.quadrature_error, tolerance);
          EXPECT_EQ(summary.message, "");
          const VectorXd error = c - refit.Changes();
          double largest_phi = 0.0;
          for (double s = 0.3; s < 3.0; s += 0.01) {
            largest_phi =
                std::max(largest_phi,
                         s * std::pow(s * s + refit.damping, -refit.exponent));
          }
          for (int i = 0, first = 0; first < J.rows();
               first += batch.rows[i++]) {
            const double norm_J = J.middleRows(first, batch.rows[i]).norm();
            EXPECT_LE(error.segment(first, batch.rows[i]).norm(),
                      (summary.quadrature_error + 1e-13) * norm_J *
                          largest_phi * g.norm());
          }
        }
      }
    }
  }
}

TEST(LeaveOneOut, GradientDescentIsTheOffDiagonalPartOfTheGramMatrix) {
  for (const SampleBatch& batch : kSampleBatches) {
    SCOPED_TRACE(batch.name);
    const MatrixXd J = JacobianOf(batch, 5);
    const VectorXd g = RandomMatrix(static_cast<int>(J.rows()), 1, 6);
    MatrixXd G = J * J.transpose();
    for (int i = 0, first = 0; first < J.rows(); first += batch.rows[i++]) {
      G.block(first, first, batch.rows[i], batch.rows[i]).setZero();
    }
    LeaveOneOutSummary summary;
    const VectorXd c =
        ChangeOf(J, g, batch.rows, SpectralFilter::GradientDescent(), &summary);
    EXPECT_LE(RelativeDistance(c, G * g), 1e-13);
    EXPECT_EQ(summary.num_shifts, 0);
    EXPECT_EQ(summary.quadrature_error, 0.0);
  }
}

TEST(LeaveOneOut, TruncationAndClampingAreJudgedByDamping) {
  const SampleBatch& batch = kSampleBatches[3];
  const MatrixXd J = 2.0 * JacobianOf(batch, 9);
  const VectorXd g = RandomMatrix(36, 1, 10);
  for (const double kappa : {0.5, 1.0}) {
    SpectralFilter filter = SpectralFilter::Power(kappa, 0.1);
    filter.damping = 0.02;
    LeaveOneOutSummary summary;
    SpectralFilter damped = SpectralFilter::Power(kappa, 0.0);
    damped.damping = filter.damping + 0.01 * LambdaMax(J);
    const VectorXd expected = ChangeOf(J, g, batch.rows, damped, &summary);
    for (const bool clamp : {false, true}) {
      filter.clamp = clamp;
      EXPECT_LE(RelativeDistance(ChangeOf(J, g, batch.rows, filter, &summary),
                                 expected),
                1e-7);
      EXPECT_NEAR(summary.damping, damped.damping, 1e-12);
      EXPECT_EQ(summary.message,
                std::string(clamp ? "clamping" : "truncation") +
                    " at tau=0.1 as damping tau^2 s_max^2");
    }
  }
}

// Samples in another order have the same c_i.
TEST(LeaveOneOut, TheOrderOfTheSamplesDoesNotMatter) {
  for (const int n : {30, 7}) {
    const std::vector<int> rows = {3, 1, 2, 5, 1, 4, 2};
    const MatrixXd J = JacobianOf({"", rows, n}, 11);
    const VectorXd g = RandomMatrix(18, 1, 12);
    MatrixXd reversed_J(18, n);
    VectorXd reversed_g(18);
    for (int i = 0, first = 0; first < 18; first += rows[i++]) {
      const int last = 18 - first - rows[i];
      reversed_J.middleRows(last, rows[i]) = J.middleRows(first, rows[i]);
      reversed_g.segment(last, rows[i]) = g.segment(first, rows[i]);
    }
    const std::vector<int> reversed_rows(rows.rbegin(), rows.rend());
    LeaveOneOutSummary summary;
    LeaveOneOutSummary reversed_summary;
    const SpectralFilter filter = Damped(0.5, 1e-3);
    const VectorXd c = ChangeOf(J, g, rows, filter, &summary);
    const VectorXd reversed = ChangeOf(
        reversed_J, reversed_g, reversed_rows, filter, &reversed_summary);
    for (int i = 0, first = 0; first < 18; first += rows[i++]) {
      const int last = 18 - first - rows[i];
      EXPECT_LE(
          (c.segment(first, rows[i]) - reversed.segment(last, rows[i])).norm(),
          1e-12 * c.norm());
    }
    EXPECT_NEAR(
        summary.score.StepSize(), reversed_summary.score.StepSize(), 1e-11);
  }
}

// Many filters, and some of the samples: the same numbers as one by one.
TEST(LeaveOneOut, ManyFiltersAndSomeSamplesShareOneFactorization) {
  for (const int n : {40, 13}) {
    const std::vector<int> rows(9, 3);
    const MatrixXd J = JacobianOf({"", rows, n}, 13);
    const VectorXd g = RandomMatrix(27, 1, 14);
    std::vector<SpectralFilter> filters = {SpectralFilter::GradientDescent()};
    for (const double kappa : {0.0, 0.5, 1.0}) {
      for (const double damping : {1e-1, 1e-3}) {
        filters.push_back(Damped(kappa, damping));
      }
    }
    LeaveOneOutOptions options;
    options.max_num_samples = 3;
    LeaveOneOut leave_one_out;
    std::string message;
    ASSERT_TRUE(
        leave_one_out.Factorize(DenseJacobian(J), g, rows, options, &message));
    EXPECT_EQ(leave_one_out.chosen(), (std::vector<int>{1, 4, 7}));
    MatrixXd changes;
    std::vector<LeaveOneOutSummary> summaries;
    ASSERT_TRUE(leave_one_out.Evaluate(filters, &changes, &summaries));
    for (size_t k = 0; k < filters.size(); ++k) {
      LeaveOneOutSummary summary;
      const VectorXd all = ChangeOf(J, g, rows, filters[k], &summary);
      VectorXd expected = VectorXd::Zero(27);
      for (const int i : {1, 4, 7}) {
        expected.segment(3 * i, 3) = all.segment(3 * i, 3);
      }
      EXPECT_LE(RelativeDistance(changes.col(k), expected), 1e-12) << k;
      EXPECT_NEAR(summaries[k].score.g_c,
                  g.dot(expected),
                  1e-12 * g.norm() * expected.norm());
    }
  }
}

// The scores against their definitions, with H_L = diag(1, ..., m).
TEST(LeaveOneOut, ScoresAreThoseOfTheirDefinitions) {
  for (const int n : {40, 13}) {
    const std::vector<int> rows(9, 3);
    const MatrixXd J = JacobianOf({"", rows, n}, 15);
    const VectorXd H_L = VectorXd::LinSpaced(27, 1.0, 27.0);
    LeaveOneOutOptions options;
    options.loss_hessian_times = [&](const VectorXd& v) {
      return VectorXd(H_L.cwiseProduct(v));
    };
    // g = G x, so that the others agree with each sample.
    const SymmetricEigen eigen(J * J.transpose());
    const VectorXd g = J * RandomMatrix(n, 1, 16);
    for (const double kappa : {-1.0, 0.5, 1.0}) {
      const SpectralFilter filter = Damped(kappa, 1e-2);
      LeaveOneOutSummary summary;
      const VectorXd c = ChangeOf(J, g, rows, filter, &summary, options);
      const double damping = 1e-2 * eigen.values.tail<1>()[0];
      VectorXd b = eigen.U.transpose() * g;
      for (int k = 0; k < 27; ++k) {
        const double l = std::max(eigen.values[k], 0.0);
        b[k] *= l * std::pow(l + damping, -filter.Exponent());
      }
      const VectorXd fitted = eigen.U * b;
      const double g_c = g.dot(c);
      ASSERT_GT(g_c, 0.0);
      EXPECT_NEAR(summary.score.StepSize(),
                  g_c / c.dot(H_L.cwiseProduct(c)),
                  1e-12 * summary.score.StepSize());
      EXPECT_NEAR(summary.score.RelativeDecrease(),
                  g_c * g_c / (c.squaredNorm() * g.squaredNorm()),
                  1e-12);
      EXPECT_NEAR(summary.score.Generalization(), g_c / g.dot(fitted), 1e-7);
      LeaveOneOutScore twice = summary.score;
      twice += summary.score;
      EXPECT_DOUBLE_EQ(twice.StepSize(), summary.score.StepSize());
      EXPECT_DOUBLE_EQ(twice.g_g, 2.0 * g.squaredNorm());
    }
  }
}

// Linear regression with noise: fresh samples lose what leaving out says.
TEST(LeaveOneOut, TheScoreIsTheDecreaseOfFreshSamples) {
  constexpr int kSamples = 40;
  constexpr int kParameters = 60;
  constexpr int kBatches = 200;
  std::mt19937 generator(35);
  std::normal_distribution<double> normal;
  const auto draw = [&](int rows, int cols) {
    return MatrixXd(MatrixXd::NullaryExpr(
        rows, cols, [&](Eigen::Index) { return normal(generator); }));
  };
  // Features of variance 1 / k^2, so that some directions can be learned.
  const VectorXd width =
      VectorXd::LinSpaced(kParameters, 1.0, kParameters).cwiseInverse();
  const VectorXd truth = draw(kParameters, 1);
  constexpr double kNoise = 0.5;
  const auto residual_of = [&](const MatrixXd& J) {
    return VectorXd(J * truth + kNoise * draw(static_cast<int>(J.rows()), 1));
  };
  for (const SpectralFilter& filter : {SpectralFilter::GradientDescent(),
                                       Damped(0.5, 1e-2),
                                       Damped(1.0, 1e-2),
                                       Damped(1.0, 1e-5)}) {
    VectorXd differences(kBatches);
    double mean_predicted = 0.0;
    for (int batch = 0; batch < kBatches; ++batch) {
      const MatrixXd J = draw(kSamples, kParameters) * width.asDiagonal();
      const VectorXd g = residual_of(J);
      LeaveOneOutSummary summary;
      ChangeOf(J, g, std::vector<int>(kSamples, 1), filter, &summary);
      const double step_size = 0.5;
      // At a given eta: 2 eta g.c - eta^2 |c|^2 relative to |g|^2.
      const double predicted =
          step_size *
          (2.0 * summary.score.g_c - step_size * summary.score.c_c) / kSamples;
      // The step of a batch with one sample less.
      const SymmetricEigen eigen(J.topRows(kSamples - 1) *
                                 J.topRows(kSamples - 1).transpose());
      VectorXd b = eigen.U.transpose() * g.head(kSamples - 1);
      for (int k = 0; k + 1 < kSamples; ++k) {
        b[k] *= std::pow(eigen.values[k] + summary.damping, -filter.Exponent());
      }
      const VectorXd step =
          -step_size * J.topRows(kSamples - 1).transpose() * (eigen.U * b);
      const MatrixXd fresh = draw(kSamples, kParameters) * width.asDiagonal();
      const VectorXd before = residual_of(fresh);
      const double measured =
          (before.squaredNorm() - (before + fresh * step).squaredNorm()) /
          kSamples;
      differences[batch] = predicted - measured;
      mean_predicted += predicted / kBatches;
    }
    const double mean = differences.mean();
    const double standard_error =
        std::sqrt((differences.array() - mean).square().sum() /
                  (kBatches - 1.0) / kBatches);
    EXPECT_LE(std::abs(mean), 3.0 * standard_error) << filter.kappa;
    // The sampling error is small enough to see a wrong prediction.
    EXPECT_LE(standard_error, 0.3 * std::abs(mean_predicted)) << filter.kappa;
  }
}

}  // namespace leave_one_out_test
}  // namespace invgrad
