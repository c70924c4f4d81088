// A linear simulator is pulled back by the inverse powers of its own J, with
// the result of a decomposition for each sample.
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/core/small_svd.h"
#include "tests/inverse/pull_one_back.h"
#include "tests/support/simulator_identities.h"

namespace invgrad {
namespace linear_pull_back_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr SimulatorWay kWays[] = {SimulatorWay::kInverseGradient,
                                  SimulatorWay::kHalfInverse,
                                  SimulatorWay::kInverse,
                                  SimulatorWay::kNumerical};

// The same map, with the inverse powers or without; counts the Jacobians.
class Wrapped final : public Simulator {
 public:
  Wrapped(const MatrixXd& A, bool is_linear)
      : simulator_(MakeLinear(A)), is_linear_(is_linear) {}

  int num_inputs() const override { return simulator_->num_inputs(); }
  int num_outputs() const override { return simulator_->num_outputs(); }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override {
    if (jacobian != nullptr) ++num_jacobians_;
    return simulator_->Evaluate(x, context, y, jacobian);
  }
  bool is_linear() const override { return is_linear_; }
  void InversePower(double kappa,
                    double tau,
                    const double* d_y,
                    double* d_x) const override {
    simulator_->InversePower(kappa, tau, d_y, d_x);
  }
  int num_jacobians() const { return num_jacobians_; }

 private:
  std::shared_ptr<const Simulator> simulator_;
  bool is_linear_;
  mutable int num_jacobians_ = 0;
};

// rows x cols of the given rank; singular values from 0.1 to 2.
MatrixXd RandomMatrix(int rows, int cols, int rank, unsigned seed) {
  SmallSvd svd;
  svd.Compute(NormalVector(rows * cols, seed).reshaped(rows, cols));
  return svd.U.leftCols(rank) *
         VectorXd::LinSpaced(rank, 2.0, 0.1).asDiagonal() *
         svd.V.leftCols(rank).transpose();
}

TEST(SmallSvd, OfAMatrixThatIsNotFiniteIsNaN) {
  for (const int size : {3, 20}) {
    MatrixXd A = MatrixXd::Identity(size, size);
    A(1, 2) = std::numeric_limits<double>::quiet_NaN();
    SmallSvd svd;
    svd.Compute(A);
    EXPECT_TRUE(svd.s.array().isNaN().all());
    EXPECT_TRUE(svd.U.array().isNaN().all());
    EXPECT_TRUE(svd.V.array().isNaN().all());
  }
}

TEST(LinearPullBack, EqualsADecompositionForEachSample) {
  const struct {
    int rows, cols, rank;
  } kShapes[] = {{6, 6, 6}, {4, 7, 4}, {7, 4, 4}, {6, 6, 3}, {5, 8, 2}};
  for (const auto& shape : kShapes) {
    const MatrixXd A = RandomMatrix(shape.rows, shape.cols, shape.rank, 1);
    const auto linear = std::make_shared<Wrapped>(A, true);
    const auto plain = std::make_shared<Wrapped>(A, false);
    const VectorXd x = NormalVector(shape.cols, 2);
    // In the range of A, so that an inverse exists.
    const VectorXd d_y = A * NormalVector(shape.cols, 3);
    for (const SimulatorWay way : kWays) {
      const auto pulled = [&](const std::shared_ptr<const Simulator>& P) {
        return Pull(SimulatorPullBack(P, nullptr, Way(way)), x, d_y);
      };
      const Pulled expected = pulled(plain);
      const Pulled found = pulled(linear);
      EXPECT_EQ(found.y, expected.y);
      EXPECT_EQ(found.result.source, expected.result.source);
      EXPECT_EQ(found.result.why, expected.result.why);
      // The iteration for the sample stops at 1e-6 |d_y|.
      const bool is_iterated =
          way == SimulatorWay::kInverse || way == SimulatorWay::kNumerical;
      EXPECT_LE((found.d_x - expected.d_x).norm(),
                (is_iterated ? 1e-5 : 0.0) * expected.d_x.norm())
          << kSimulatorWayNames[static_cast<int>(way)] << ", " << shape.rows
          << " x " << shape.cols << ", rank " << shape.rank;
    }
    EXPECT_EQ(linear->num_jacobians(), 0);
    EXPECT_GT(plain->num_jacobians(), 0);
  }
}

TEST(LinearPullBack, InverseIsTheClosestSolutionToRounding) {
  const MatrixXd A = RandomMatrix(5, 8, 3, 4);
  const VectorXd x = NormalVector(8, 5);
  // A^+ (A v) is v without its part in the null space.
  const VectorXd v = A.transpose() * NormalVector(5, 6);
  const Pulled pulled = Pull(
      SimulatorPullBack(MakeLinear(A), nullptr, Way(SimulatorWay::kInverse)),
      x,
      A * v);
  EXPECT_EQ(pulled.result.source, PullBackSource::kNumericalInverse);
  EXPECT_LT((pulled.d_x - v).norm(), 1e-13 * v.norm());
}

// Nothing reaches the part of d_y outside the range: the inverse fails, and the
// inverse gradient moves as near as possible, as for any other simulator.
TEST(LinearPullBack, ATargetOutOfRangeIsApproached) {
  const MatrixXd A = RandomMatrix(6, 6, 3, 7);
  SmallSvd svd;
  svd.Compute(A);
  const VectorXd v = A.transpose() * NormalVector(6, 8);
  const VectorXd d_y = A * v + svd.U.col(5);
  const VectorXd x = NormalVector(6, 9);
  for (const bool is_linear : {false, true}) {
    const Pulled pulled =
        Pull(SimulatorPullBack(std::make_shared<Wrapped>(A, is_linear),
                               nullptr,
                               Way(SimulatorWay::kNumerical)),
             x,
             d_y);
    EXPECT_EQ(pulled.result.source, PullBackSource::kInverseGradient);
    EXPECT_NE(pulled.result.why, "");
    EXPECT_LT((pulled.d_x - v).norm(), 1e-12 * v.norm());
  }
}

TEST(LinearPullBack, IdentityIsItsInversePower) {
  const auto identity = std::make_shared<IdentitySimulator>(3);
  const VectorXd d_y = NormalVector(3, 1);
  for (const SimulatorWay way : kWays) {
    const Pulled pulled = Pull(
        SimulatorPullBack(identity, nullptr, Way(way)), VectorXd::Zero(3), d_y);
    EXPECT_EQ(pulled.d_x, d_y);
  }
  VectorXd d_x(3);
  identity->InversePower(0.5, 1.0, d_y.data(), d_x.data());
  EXPECT_EQ(d_x, VectorXd::Zero(3));  // no s > 1 s_max
}

// The first calls decompose; a copy shares the result.
TEST(LinearPullBack, ThreadsShareOneDecomposition) {
  const MatrixXd A = RandomMatrix(20, 20, 20, 10);
  const LinearSimulator simulator(A.sparseView(), VectorXd::Zero(20));
  const LinearSimulator copy = simulator;  // NOLINT: the copy is the test
  const VectorXd d_y = NormalVector(20, 11);
  std::vector<VectorXd> results(4, VectorXd(20));
  std::vector<std::thread> threads;
  for (size_t i = 0; i < results.size(); ++i) {
    threads.emplace_back([&, i]() {
      const LinearSimulator& own = i % 2 == 0 ? simulator : copy;
      own.InversePower(0.5, 0.0, d_y.data(), results[i].data());
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const VectorXd& result : results) EXPECT_EQ(result, results[0]);
  EXPECT_GT(results[0].norm(), 0.0);
}

}  // namespace linear_pull_back_test
}  // namespace invgrad
