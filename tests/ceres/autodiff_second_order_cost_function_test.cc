#include <vector>

#include "Eigen/Core"
#include "ceres/cost_function.h"
#include "ceres/types.h"
#include "gtest/gtest.h"
#include "invgrad/second_order_cost_function.h"

namespace invgrad {
namespace second_order_cost_function_test {

using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Two blocks, of 2 and 1: r = (x0 x1 y, sin(x0) + 2 y^3).
struct TwoBlocks {
  template <typename T>
  bool operator()(const T* x, const T* y, T* r) const {
    r[0] = x[0] * x[1] * y[0];
    r[1] = sin(x[0]) + 2.0 * y[0] * y[0] * y[0];
    return y[0] < 10.0;
  }
};

TEST(SecondOrderCostFunction, ClosedForm) {
  const AutoDiffSecondOrderCostFunction<TwoBlocks, 2, 2, 1> cost_function(
      new TwoBlocks);
  EXPECT_EQ(cost_function.num_residuals(), 2);
  EXPECT_EQ(cost_function.parameter_block_sizes(), std::vector<int>({2, 1}));

  const double x[2] = {0.4, -1.5};
  const double y[1] = {0.7};
  const double* parameters[] = {x, y};
  const double w[2] = {3.0, -0.5};
  RowMajorMatrix H(3, 3);
  ASSERT_TRUE(cost_function.WeightedHessian(parameters, w, H.data()));
  RowMajorMatrix expected(3, 3);
  expected << -w[1] * std::sin(x[0]), w[0] * y[0], w[0] * x[1],  //
      w[0] * y[0], 0.0, w[0] * x[0],                             //
      w[0] * x[1], w[0] * x[0], w[1] * 12.0 * y[0];
  EXPECT_LT((H - expected).norm(), 1e-14 * expected.norm());
}

TEST(SecondOrderCostFunction, EvaluatesAsAutoDiffCostFunction) {
  const AutoDiffSecondOrderCostFunction<TwoBlocks, 2, 2, 1> cost_function(
      new TwoBlocks);
  const double x[2] = {0.4, -1.5};
  const double y[1] = {0.7};
  const double* parameters[] = {x, y};
  double residuals[2];
  double jacobian_x[4];
  double jacobian_y[2];
  double* jacobians[] = {jacobian_x, jacobian_y};
  ASSERT_TRUE(cost_function.Evaluate(parameters, residuals, jacobians));
  EXPECT_DOUBLE_EQ(residuals[0], x[0] * x[1] * y[0]);
  EXPECT_DOUBLE_EQ(jacobian_x[0], x[1] * y[0]);
  EXPECT_DOUBLE_EQ(jacobian_x[2], std::cos(x[0]));
  EXPECT_DOUBLE_EQ(jacobian_y[1], 6.0 * y[0] * y[0]);
}

TEST(SecondOrderCostFunction, FunctorFailureTravels) {
  const AutoDiffSecondOrderCostFunction<TwoBlocks, 2, 2, 1> cost_function(
      new TwoBlocks);
  const double x[2] = {0.4, -1.5};
  const double y[1] = {11.0};
  const double* parameters[] = {x, y};
  const double w[2] = {1.0, 1.0};
  double hessian[9];
  EXPECT_FALSE(cost_function.WeightedHessian(parameters, w, hessian));
}

struct Squares {
  explicit Squares(int size) : size(size) {}
  template <typename T>
  bool operator()(const T* x, T* r) const {
    for (int i = 0; i < size; ++i) r[i] = double(i + 1) * x[0] * x[0];
    return true;
  }
  int size;
};

// Also: a functor that somebody else owns.
TEST(SecondOrderCostFunction, DynamicNumberOfResiduals) {
  Squares functor(3);
  const AutoDiffSecondOrderCostFunction<Squares, ceres::DYNAMIC, 1>
      cost_function(&functor, 3, ceres::DO_NOT_TAKE_OWNERSHIP);
  EXPECT_EQ(cost_function.num_residuals(), 3);
  const double x[1] = {5.0};
  const double* parameters[] = {x};
  const double w[3] = {1.0, 10.0, 100.0};
  double hessian = 0.0;
  ASSERT_TRUE(cost_function.WeightedHessian(parameters, w, &hessian));
  EXPECT_DOUBLE_EQ(hessian, 2.0 * (1.0 + 20.0 + 300.0));
}

}  // namespace second_order_cost_function_test
}  // namespace invgrad
