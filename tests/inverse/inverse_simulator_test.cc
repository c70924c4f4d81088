#include "invgrad/inverse_simulator.h"

#include <memory>
#include <optional>
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"

namespace invgrad {
namespace inverse_simulator_test {

using Eigen::Vector2d;
using Eigen::VectorXd;
using ConstVectorRef = InverseSimulator::ConstVectorRef;

VectorXd Invert(const InverseSimulator& inverse,
                const VectorXd& y,
                const VectorXd& x_now,
                const VectorXd& context = VectorXd()) {
  VectorXd x = VectorXd::Ones(7);  // any size
  std::string why;
  EXPECT_TRUE(inverse.Invert(y, x_now, context, &x, &why)) << why;
  return x;
}

TEST(InverseTest, TakesFunctionsWithAndWithoutContext) {
  const Vector2d y(1.0, 2.0);
  const Vector2d x_now(10.0, 20.0);
  const auto local = Inverse(
      [](const auto& wanted, const auto& now) -> std::optional<VectorXd> {
        return VectorXd(wanted + now);
      });
  EXPECT_EQ(Invert(*local, y, x_now), Vector2d(11.0, 22.0));
  EXPECT_TRUE(local->reaches_target());
  const auto with_context =
      Inverse([](const auto& wanted, const auto& now, const auto& context) {
        return VectorXd(wanted + now * context[0]);
      });
  EXPECT_EQ(Invert(*with_context, y, x_now, VectorXd::Constant(1, 0.5)),
            Vector2d(6.0, 12.0));
}

std::optional<VectorXd> Global(const ConstVectorRef& y,
                               const ConstVectorRef& /*x_now*/) {
  if (y[0] < 0.0) return std::nullopt;
  return VectorXd(y.cwiseSqrt());
}

TEST(InverseTest, TakesPlainFunctions) {
  EXPECT_EQ(Invert(*Inverse(Global), Vector2d(4.0, 9.0), Vector2d::Zero()),
            Vector2d(2.0, 3.0));
}

TEST(InverseTest, NothingIsAFailureThatNamesY) {
  const auto inverse = Inverse(Global);
  VectorXd x = VectorXd::Ones(2);
  std::string why;
  EXPECT_FALSE(
      inverse->Invert(VectorXd::Constant(1, -1.5), x, VectorXd(), &x, &why));
  EXPECT_EQ(why, "the inverse has no x for y = (-1.5)");
  EXPECT_EQ(x.size(), 0);  // no answer that accept_nearer could take
  EXPECT_FALSE(inverse->Invert(
      VectorXd::LinSpaced(4, -1.0, 2.0), x, VectorXd(), &x, &why));
  EXPECT_EQ(why, "the inverse has no x for y = (-1, 0, 1, ...)");
}

}  // namespace inverse_simulator_test
}  // namespace invgrad
