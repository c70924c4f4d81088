#include "problems/estimation/robust_loss.h"

#include <memory>
#include <string>

#include "gtest/gtest.h"

namespace invgrad {
namespace robust_loss_test {

// rho(s) of the loss that the text names.
double Loss(const std::string& text, double s) {
  MakeLossFunction make_loss;
  std::string error;
  EXPECT_TRUE(ParseRobustLoss(text, &make_loss, &error)) << error;
  const std::unique_ptr<ceres::LossFunction> loss(make_loss());
  double rho[3] = {0.0, 0.0, 0.0};
  loss->Evaluate(s, rho);
  return rho[0];
}

TEST(RobustLoss, IsThatOfCeres) {
  MakeLossFunction make_loss;
  std::string error;
  ASSERT_TRUE(ParseRobustLoss("none", &make_loss, &error));
  EXPECT_EQ(make_loss(), nullptr);
  // 2 a |r| - a^2 outside of a, at |r| = 3
  EXPECT_DOUBLE_EQ(Loss("huber", 9.0), 5.0);
  EXPECT_DOUBLE_EQ(Loss("huber:2", 9.0), 8.0);
  for (const char* name : {"soft_l_one", "cauchy", "arctan", "tukey"}) {
    const std::string scaled = std::string(name) + ":10";
    EXPECT_LT(Loss(name, 9.0), Loss(scaled, 9.0)) << name;
    EXPECT_LT(Loss(scaled, 9.0), 9.0) << name;
  }
}

TEST(RobustLoss, RefusesWhatIsNone) {
  MakeLossFunction make_loss;
  for (const char* text : {"",
                           "hubert",
                           "huber:",
                           "huber:0",
                           "huber:-1",
                           "huber:x",
                           "huber:nan",
                           "none:1"}) {
    std::string error;
    EXPECT_FALSE(ParseRobustLoss(text, &make_loss, &error)) << text;
    EXPECT_NE(error.find("allowed"), std::string::npos) << error;
  }
}

}  // namespace robust_loss_test
}  // namespace invgrad
