// Rules that judge the weights by the loss of new batches.

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/rules.h"
#include "invgrad/train.h"
#include "invgrad/update_rule.h"
#include "tests/support/train_options.h"
#include "tests/train/regression.h"

namespace invgrad {
namespace train_judged_weights_test {

// L = 10 - y_0, which has no value for y_0 > 1 where y*_1 = 1.
class LimitedLoss final : public Loss {
 public:
  int size() const override { return 2; }
  bool Evaluate(const double* y,
                const double* target,
                double* loss,
                double* gradient,
                double* hessian) const override {
    *loss = 10.0 - y[0];
    if (gradient != nullptr) {
      gradient[0] = -1.0;
      gradient[1] = 0.0;
    }
    if (hessian != nullptr) Eigen::Map<Eigen::Matrix2d>(hessian).setZero();
    return target[1] != 1.0 || y[0] <= 1.0;
  }
};

// Steps along -gradient by which y_0 grows by `length(k)` in step k, with a
// given verdict before it.
class ScriptedRule final : public UpdateRule, public StepJudge {
 public:
  using Script =
      std::function<Verdict(int k, double cost, OtherWeights* others)>;
  explicit ScriptedRule(Script script) : script_(std::move(script)) {}

  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string*) override {
    *step = -length * at_x.gradient;
    return true;
  }
  StepJudge* judge() override { return this; }
  bool KeepsStep(double /*cost*/, double /*fraction*/) override { return true; }
  bool JudgesWeights() const override { return true; }
  Verdict JudgeWeights(double cost, OtherWeights* others) override {
    costs.push_back(cost);
    const Verdict verdict =
        script_(static_cast<int>(costs.size()) - 1, cost, others);
    if (verdict == Verdict::kLeaveOut) length = -1.0;
    return verdict;
  }

  double length = 0.4;
  std::vector<double> costs;

 private:
  Script script_;
};

using Verdict = StepJudge::Verdict;
using OtherWeights = StepJudge::OtherWeights;

// y = b for inputs zero: 24 samples in 6 batches, of which the fifth is limited.
TrainResult TrainScripted(ScriptedRule* rule, int num_steps) {
  const Model model(DenseNetwork({2, 2}, Activation::kTanh),
                    std::make_shared<IdentitySimulator>(2),
                    std::make_shared<LimitedLoss>(),
                    Reduction::kMean);
  Eigen::MatrixXd targets = Eigen::MatrixXd::Zero(2, 24);
  targets.block(1, 16, 1, 4).setOnes();
  TrainOptions options;
  options.batch_size = 4;
  options.max_num_steps = num_steps;
  options.initial_weights = Eigen::VectorXd::Zero(6);
  TrainResult result = Train(
      model, {Eigen::MatrixXd::Zero(2, 24), targets}, Borrowed(rule), options);
  EXPECT_EQ(result.error, "");
  return result;
}

TEST(JudgedWeights, ReturnToTheirCopy) {
  ScriptedRule rule([](int k, double, OtherWeights* others) {
    if (k == 1) return Verdict::kCopy;
    if (k != 3) return Verdict::kGoOn;
    EXPECT_DOUBLE_EQ(others->CostBeforeLastStep(), 9.2);
    EXPECT_DOUBLE_EQ(others->CostAtCopy(), 9.6);
    return Verdict::kUndoToCopy;
  });
  const TrainResult result = TrainScripted(&rule, 4);
  // y_0 = 0, 0.4 (copied), 0.8, 1.2 -> 0.4, and after the fourth step 0.8.
  ASSERT_EQ(rule.costs.size(), 4u);
  EXPECT_DOUBLE_EQ(rule.costs[3], 8.8);
  EXPECT_DOUBLE_EQ(result.history.back().train_loss, 9.2);
  EXPECT_EQ(result.summary.num_undone, 1);
}

TEST(JudgedWeights, ReturnToBeforeTheLastStep) {
  ScriptedRule rule([](int k, double, OtherWeights*) {
    return k == 2 ? Verdict::kUndoStep : Verdict::kGoOn;
  });
  // y_0 = 0, 0.4, 0.8 -> 0.4, 0.8.
  const TrainResult result = TrainScripted(&rule, 3);
  EXPECT_DOUBLE_EQ(result.history.back().train_loss, 9.2);
  EXPECT_EQ(result.summary.num_undone, 1);
}

TEST(JudgedWeights, TheCopyCanBeOfBeforeTheLastStep) {
  ScriptedRule rule([](int k, double, OtherWeights* others) {
    EXPECT_EQ(std::isnan(others->CostBeforeLastStep()), k == 0);
    EXPECT_EQ(std::isnan(others->CostAtCopy()), k <= 2);
    if (k == 2) return Verdict::kCopyBefore;
    return k == 3 ? Verdict::kUndoToCopy : Verdict::kGoOn;
  });
  // y_0 = 0, 0.4 (copied later), 0.8, 1.2 -> 0.4, 0.8.
  const TrainResult result = TrainScripted(&rule, 4);
  EXPECT_DOUBLE_EQ(result.history.back().train_loss, 9.2);
}

// At step 4 y_0 = 1.6, which the limited samples do not allow; nor 1.2.
TEST(JudgedWeights, ABatchWithoutALossIsLeftOut) {
  ScriptedRule rule([](int k, double cost, OtherWeights* others) {
    if (std::isfinite(cost)) return k == 3 ? Verdict::kCopy : Verdict::kGoOn;
    EXPECT_TRUE(std::isnan(others->CostBeforeLastStep()));
    EXPECT_TRUE(std::isnan(others->CostAtCopy()));
    return Verdict::kLeaveOut;
  });
  const TrainResult result = TrainScripted(&rule, 6);
  // The weights are those before the step that led there: 1.2, then -1.
  EXPECT_EQ(result.summary.termination_type, ceres::NO_CONVERGENCE)
      << result.summary.message;
  EXPECT_EQ(result.summary.num_steps, 6);
  EXPECT_DOUBLE_EQ(result.history.back().train_loss, 10.0 - 0.2);
}

// At step 4 y_0 = 1.6; the copy is at 0.8.
TEST(JudgedWeights, ABatchWithoutALossReturnsToWhereItHasOne) {
  ScriptedRule rule([](int k, double cost, OtherWeights* others) {
    if (std::isfinite(cost)) return k == 2 ? Verdict::kCopy : Verdict::kGoOn;
    EXPECT_DOUBLE_EQ(others->CostAtCopy(), 9.2);
    return Verdict::kUndoToCopy;
  });
  const TrainResult result = TrainScripted(&rule, 5);
  // The last step leads to 1.2, where the train loss has no value: the run ends
  // with the weights before it.
  EXPECT_DOUBLE_EQ(result.history.back().train_loss, 9.2);
}

TEST(JudgedWeights, WithoutNewSamplesAdaptiveIsAdaptivePower) {
  const Regression problem;
  TrainOptions options = Epochs(30, 0);
  const auto adaptive = MakeRule("adaptive");
  const auto power = MakeRule("adaptive_power");
  EXPECT_EQ(TrainRegression(problem, options, adaptive.get()).weights,
            TrainRegression(problem, options, power.get()).weights);
}

TEST(JudgedWeights, ARunOnNewSamplesIsDeterministic) {
  const Regression problem;
  TrainOptions options = Epochs(20, 8);
  options.shuffle = true;
  const auto one = MakeRule("adaptive");
  const auto other = MakeRule("adaptive");
  const TrainResult result = TrainRegression(problem, options, one.get());
  EXPECT_EQ(result.weights,
            TrainRegression(problem, options, other.get()).weights);
  EXPECT_LT(result.history.back().test_loss,
            1e-3 * result.history.front().test_loss);
}

}  // namespace train_judged_weights_test
}  // namespace invgrad
