#include "problems/equations/two_solitons.h"

#include <algorithm>

#include "Eigen/Core"
#include "gtest/gtest.h"

namespace invgrad {
namespace two_solitons_test {

using Eigen::Vector2d;
using Eigen::VectorXd;

// Far apart, a soliton of speed c is 3 c / cosh^2(sqrt(c) / 2 (x - c t - x_0)):
// at t = 5 the fast one, at 28 and more, has left the slow one behind.
TEST(TwoSolitons, AreSolitonsBeforeAndAfter) {
  const auto highest = [](double t, double begin, double end) {
    double height = 0.0;
    for (double x = begin; x < end; x += 0.001) {
      height = std::max(height, TwoSolitonsPinn::Solution(t, x));
    }
    return height;
  };
  EXPECT_NEAR(highest(0.0, -20.0, 0.0), 18.0, 0.05);
  EXPECT_NEAR(highest(5.0, 0.0, 20.0), 6.0, 1e-4);
  EXPECT_NEAR(highest(5.0, 20.0, 40.0), 18.0, 1e-4);
}

TEST(TwoSolitons, SlopeIsThatOfTheClosedForm) {
  const EquationProblem problem = TwoSolitonsPinn().MakeEquation();
  const EquationTerm& slope = problem.equation.terms[1];
  for (const double t : {1.0, 3.5, 4.2}) {
    VectorXd c(1);
    slope.context(Vector2d(t, 20.0), 0, c);
    constexpr double h = 1e-5;
    EXPECT_NEAR(c[0],
                (TwoSolitonsPinn::Solution(t, 20.0 + h) -
                 TwoSolitonsPinn::Solution(t, 20.0 - h)) /
                    (2.0 * h),
                1e-7);
    const double u[] = {0.0, 0.0, c[0] + 0.5, 0.0};
    double y;
    ASSERT_TRUE(slope.residual->Evaluate(u, c.data(), &y, nullptr));
    EXPECT_NEAR(y, 0.5, 1e-14);
  }
}

}  // namespace two_solitons_test
}  // namespace invgrad
