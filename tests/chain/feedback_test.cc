#include "invgrad/chain/feedback.h"

#include <vector>

#include "Eigen/Core"
#include "Eigen/LU"
#include "gtest/gtest.h"
#include "invgrad/chain/time_stepping_simulator.h"
#include "tests/chain/pendulum_step.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace feedback_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// (I - K S)^-1 as matrices, from s_{t+1} = A_t s_t + B_t u_t alone.
TEST(CloseLoop, IsTheInverseOfTheMatrixThatItDoesNotForm) {
  const int num_calls = 4;
  const int ns = 2;
  const int nc = 2;
  const int num_x = num_calls * nc;
  const TimeSteppingSimulator<PendulumStep> simulator(
      PendulumStep{nc}, ns, nc, num_calls);
  const VectorXd x = RandomMatrix(num_x, 1, 1);
  const VectorXd start = RandomMatrix(ns, 1, 2);
  const MatrixXd K_blocks = RandomMatrix(ns, num_x, 3);
  std::vector<double> M(num_calls * ns * (ns + nc));
  ASSERT_TRUE(simulator.StepJacobians(x.data(), start.data(), M.data()));
  MatrixXd KS = MatrixXd::Zero(num_x, num_x);
  MatrixXd S_t = MatrixXd::Zero(ns, num_x);  // ds_t/dx
  for (int t = 0; t < num_calls; ++t) {
    KS.middleRows(t * nc, nc) =
        K_blocks.middleCols(t * nc, nc).transpose() * S_t;
    const Eigen::Map<
        const Eigen::
            Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>
        M_t(M.data() + t * ns * (ns + nc), ns, ns + nc);
    S_t = (M_t.leftCols(ns) * S_t).eval();
    S_t.middleCols(t * nc, nc) += M_t.rightCols(nc);
  }
  const MatrixXd before = RandomMatrix(num_x, 5, 4);
  MatrixXd after = before;
  ASSERT_TRUE(CloseLoop(simulator, x.data(), start.data(), K_blocks, after));
  const MatrixXd I = MatrixXd::Identity(num_x, num_x);
  const MatrixXd expected = (I - KS).transpose().lu().solve(before);
  EXPECT_GT((expected - before).norm(), 0.1 * before.norm());
  EXPECT_LT((after - expected).norm(), 1e-14 * expected.norm());
}

TEST(CloseLoop, OneCallOrNoReactionChangesNothing) {
  const VectorXd start = RandomMatrix(2, 1, 2);
  for (const int num_calls : {1, 3}) {
    const TimeSteppingSimulator<PendulumStep> simulator(
        PendulumStep(), 2, 1, num_calls);
    const VectorXd x = RandomMatrix(num_calls, 1, 1);
    const MatrixXd K = num_calls == 1 ? RandomMatrix(2, 1, 3)
                                      : MatrixXd(MatrixXd::Zero(2, num_calls));
    const MatrixXd before = RandomMatrix(num_calls, 2, 4);
    MatrixXd after = before;
    ASSERT_TRUE(CloseLoop(simulator, x.data(), start.data(), K, after));
    EXPECT_EQ(after, before);
  }
}

}  // namespace feedback_test
}  // namespace invgrad
