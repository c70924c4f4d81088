// The residual blocks of a ceres::Problem as samples, each of which is left out:
// blocks of 1 to 3 rows, two that are equal, and two with parameter blocks of
// their own.

#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/crs_matrix.h"
#include "ceres/loss_function.h"
#include "ceres/problem.h"
#include "gtest/gtest.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/spectral/gradient_noise.h"
#include "invgrad/spectral/leave_one_out.h"
#include "tests/spectral/refit.h"

namespace invgrad {
namespace left_out_blocks_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// r_i = sin(phase + i + sum_k (1 + i k) a_k) + b_0 b_last
template <int kRows, int kA, int kB>
struct Wave {
  template <typename T>
  bool operator()(const T* a, const T* b, T* r) const {
    for (int i = 0; i < kRows; ++i) {
      T sum(phase + i);
      for (int k = 0; k < kA; ++k) sum += (1.0 + i * k) * a[k];
      r[i] = sin(sum) + b[0] * b[kB - 1];
    }
    return true;
  }
  static ceres::CostFunction* New(double phase) {
    return new ceres::AutoDiffCostFunction<Wave, kRows, kA, kB>(
        new Wave{phase});
  }
  double phase;
};

// m = 14; n = kA + 8.
template <int kA>
class BlocksToLeaveOut {
 public:
  BlocksToLeaveOut() {
    for (int k = 0; k < kA; ++k) a_[k] = 0.3 - 0.1 * k;
    Add(Wave<1, kA, 2>::New(0.1), a_, b_);
    Add(Wave<3, kA, 2>::New(0.7), a_, b_);
    problem_.AddResidualBlock(
        Wave<2, 2, kA>::New(1.9), new ceres::HuberLoss(0.5), b_, a_);
    Add(Wave<2, kA, 2>::New(0.4), a_, b_);             // block 3
    Add(Wave<2, kA, 2>::New(0.4), a_, b_);             // block 4
    Add(Wave<1, 2, 1>::New(0.2), own_, own_ + 2);      // block 5
    Add(Wave<3, 2, 1>::New(2.2), own_ + 3, own_ + 5);  // block 6
  }

  const ceres::Problem& problem() const { return problem_; }
  ceres::Problem* mutable_problem() { return &problem_; }

 private:
  void Add(ceres::CostFunction* cost_function, double* a, double* b) {
    problem_.AddResidualBlock(cost_function, nullptr, a, b);
  }

  ceres::Problem problem_;
  double a_[kA];
  double b_[2] = {0.8, -0.4};
  double own_[6] = {0.2, -0.5, 0.9, 0.6, 0.1, -0.7};
};

struct LeftOutBlocks {
  Linearization at_x;
  std::vector<int> rows;
  // Of Ceres, with the linearizer's columns.
  MatrixXd J;
  VectorXd g;
};

LeftOutBlocks Linearized(
    ceres::Problem* problem,
    const std::vector<ceres::ResidualBlockId>& residual_blocks) {
  ProblemLinearizer::Options options;
  options.residual_blocks = residual_blocks;
  const ProblemLinearizer linearizer(problem, options);
  LeftOutBlocks result;
  std::string error;
  EXPECT_TRUE(linearizer.Linearize(
      LinearizationParts::Jacobian(), &result.at_x, &error))
      << error;
  for (const auto& block : linearizer.structure().residual_blocks) {
    result.rows.push_back(block.size);
  }
  ceres::Problem::EvaluateOptions evaluate_options;
  evaluate_options.residual_blocks = residual_blocks;
  for (const auto& block : linearizer.structure().parameter_blocks) {
    evaluate_options.parameter_blocks.push_back(block.values);
  }
  std::vector<double> residuals;
  ceres::CRSMatrix jacobian;
  EXPECT_TRUE(problem->Evaluate(
      evaluate_options, nullptr, &residuals, nullptr, &jacobian));
  result.g = Eigen::Map<const VectorXd>(residuals.data(), residuals.size());
  result.J = MatrixXd::Zero(jacobian.num_rows, jacobian.num_cols);
  for (int row = 0; row < jacobian.num_rows; ++row) {
    for (int k = jacobian.rows[row]; k < jacobian.rows[row + 1]; ++k) {
      result.J(row, jacobian.cols[k]) = jacobian.values[k];
    }
  }
  return result;
}

VectorXd ChangesOf(const LeftOutBlocks& blocks,
                   const SpectralFilter& filter,
                   LeaveOneOutSummary* summary) {
  VectorXd c;
  EXPECT_TRUE(LeaveOneOutChange(*blocks.at_x.jacobian,
                                blocks.at_x.loss_gradient,
                                blocks.rows,
                                filter,
                                {},
                                &c,
                                summary))
      << summary->message;
  return c;
}

void ExpectFinite(const VectorXd& c, const LeaveOneOutScore& score) {
  EXPECT_TRUE(c.allFinite());
  for (const double number : {score.g_c,
                              score.c_c,
                              score.c_H_c,
                              score.g_g,
                              score.g_fitted,
                              score.StepSize(),
                              score.RelativeDecrease(),
                              score.Generalization()}) {
    EXPECT_TRUE(std::isfinite(number)) << number;
  }
}

template <int kA>
void ExpectEqualsRefitting() {
  BlocksToLeaveOut<kA> owner;
  const LeftOutBlocks blocks = Linearized(owner.mutable_problem(), {});
  ASSERT_EQ(blocks.rows, (std::vector<int>{1, 3, 2, 2, 2, 1, 3}));
  ASSERT_EQ(blocks.J.cols(), kA + 8);
  for (const double kappa : {-1.0, 0.5, 1.0}) {
    for (const double damping : {1e-3, 0.0}) {
      SCOPED_TRACE(testing::Message() << kA << " " << kappa << " " << damping);
      const SpectralFilter filter = Damped(kappa, damping);
      LeaveOneOutSummary summary;
      const VectorXd c = ChangesOf(blocks, filter, &summary);
      ASSERT_EQ(c.size(), 14);
      ExpectFinite(c, summary.score);
      // Undamped, the equal blocks raise lambda to sqrt(resolution l_min) s_max,
      // 1e-8 to 1e-7 s_max^2: rounding has a share of 1e-15 s_max^2 / lambda.
      const bool is_raised = damping == 0.0 && kappa > -1.0;
      EXPECT_EQ(summary.message.rfind("damping raised to ", 0) == 0, is_raised)
          << summary.message;
      const double tolerance = is_raised ? 1e-5 : 1e-7;
      Refit refit = RefitOf(blocks.J, blocks.g, blocks.rows, filter);
      if (is_raised) {
        EXPECT_LE(summary.damping, 1e-7 * LambdaMax(blocks.J));
        refit.damping = summary.damping;
      }
      EXPECT_LE(RelativeDistance(c, refit.Changes()), tolerance);
      // What the others cannot know, and what they know alike.
      EXPECT_LE(c.tail(4).norm(), tolerance * blocks.g.norm());
      EXPECT_LE((c.segment(6, 2) - c.segment(8, 2)).norm(),
                tolerance * c.norm());
      EXPECT_GT(c.segment(6, 2).norm(), 0.0);
    }
  }
}

TEST(LeftOutBlocks, EqualRefittingWithMoreRowsThanParameters) {
  ExpectEqualsRefitting<3>();
}

TEST(LeftOutBlocks, EqualRefittingWithMoreParametersThanRows) {
  ExpectEqualsRefitting<9>();
}

TEST(LeftOutBlocks, OneBlockAloneLearnsNothing) {
  BlocksToLeaveOut<3> owner;
  std::vector<ceres::ResidualBlockId> ids;
  owner.problem().GetResidualBlocks(&ids);
  for (const ceres::ResidualBlockId id : ids) {
    const LeftOutBlocks blocks = Linearized(owner.mutable_problem(), {id});
    ASSERT_EQ(blocks.rows.size(), 1u);
    for (const double kappa : {-1.0, 0.5, 1.0}) {
      LeaveOneOutSummary summary;
      const VectorXd c = ChangesOf(blocks, Damped(kappa, 0.0), &summary);
      EXPECT_EQ(c, VectorXd::Zero(blocks.rows[0]));
      ExpectFinite(c, summary.score);
    }
  }
}

// Two equal blocks have no noise, two that share nothing nothing but noise.
TEST(LeftOutBlocks, NoiseScale) {
  BlocksToLeaveOut<3> owner;
  std::vector<ceres::ResidualBlockId> ids;
  owner.problem().GetResidualBlocks(&ids);
  const auto noise_scale = [&](int i, int j) {
    LeaveOneOutSummary summary;
    ChangesOf(Linearized(owner.mutable_problem(), {ids[i], ids[j]}),
              SpectralFilter::GradientDescent(),
              &summary);
    return GradientNoiseScale(summary.score, 2);
  };
  EXPECT_LE(noise_scale(3, 4), 1e-13);
  EXPECT_GE(noise_scale(5, 6), 1e13);
}

}  // namespace left_out_blocks_test
}  // namespace invgrad
