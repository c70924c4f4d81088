// Rules that a user adds to the table. Each test registers in a process of its
// own, so that the tests of the table see the library's rules only.
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "glog/logging.h"
#include "gtest/gtest.h"
#include "invgrad/method.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"

namespace invgrad {
namespace register_rule_test {

// step = -gradient
class Plain final : public UpdateRule {
 public:
  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string*) override {
    *step = -at_x.gradient;
    return true;
  }
};

// step = -eta gradient
class Scaled final : public UpdateRule {
 public:
  struct Options {
    double eta = 0.5;
    void Describe(OptionSet* set) { set->Add("eta", &eta, {0.0, 1.0}, "eta"); }
  };
  explicit Scaled(const Options& options) : eta_(options.eta) {}
  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string*) override {
    *step = -eta_ * at_x.gradient;
    return true;
  }

 private:
  const double eta_;
};

Eigen::VectorXd StepOf(const std::string& rule_text) {
  Linearization at_x;
  at_x.gradient = Eigen::Vector2d(4.0, -2.0);
  Eigen::VectorXd step;
  std::string error;
  CHECK(MakeRule(rule_text)->ComputeStep(at_x, &step, &error)) << error;
  return step;
}

// CHECKs in place of EXPECTs: they end the child process.
void UseByName() {
  const RuleRow* const adam = FindRule("adam");
  const std::size_t num_rules = Rules().size();
  RegisterRule<Plain>("plain", "step = -gradient");
  RegisterRule<Scaled>("scaled", "step = -eta gradient");
  RegisterRule<Scaled>("quarter", "step = -eta gradient", {0.25});
  // Many, so that a table that moves its rows would be found out.
  for (int i = 0; i < 1000; ++i) {
    RegisterRule<Plain>("plain" + std::to_string(i), "step = -gradient");
  }
  CHECK_EQ(Rules().size(), num_rules + 1003);
  CHECK_EQ(FindRule("adam"), adam);
  CHECK_EQ(adam->name, "adam");

  CHECK_EQ(StepOf("plain"), Eigen::Vector2d(-4.0, 2.0));
  CHECK_EQ(StepOf("scaled"), Eigen::Vector2d(-2.0, 1.0));
  CHECK_EQ(StepOf("quarter"), Eigen::Vector2d(-1.0, 0.5));
  CHECK_EQ(StepOf("quarter:eta=1"), Eigen::Vector2d(-4.0, 2.0));
  CHECK(FindRule("plain")->options().empty());
  CHECK_EQ(FindRule("quarter")->options()[0].default_value, "0.25");
  std::string error;
  CHECK(MakeRule("scald", &error) == nullptr);
  CHECK_EQ(error, "unknown rule 'scald'; did you mean scaled?");
  CHECK(MakeRule("plain:eta=1", &error) == nullptr);
  CHECK_EQ(error, "plain: unknown option 'eta'; known: ");
  CHECK(MakeRule("scaled:eta=2", &error) == nullptr);
  CHECK_EQ(error, "scaled: eta=2 is out of range; allowed: [0, 1]");

  std::vector<Method> methods;
  CHECK(ParseMethods("scaled:eta=0.1,ceres_lm+scaled", &methods, &error))
      << error;
  CHECK_EQ(methods.size(), 2u);
}

struct Offset {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] - 10.0;
    return true;
  }
};

void UseInsideCeres() {
  RegisterRule<Plain>("plain", "step = -gradient");
  double x = 0.0;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Offset, 1, 1>(new Offset), nullptr, &x);
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  const auto rule = MakeRule("plain");
  UpdateCallback::Options callback_options;
  callback_options.compare_with_plain = false;  // Ceres takes two steps
  UpdateCallback callback(rule.get(), &problem, callback_options);
  callback.AddTo(&options);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  CHECK_EQ(x, 10.0);
  CHECK_EQ(callback.summary().num_accepted, 1);
}

TEST(RegisterRule, MakesARuleKnownByName) {
  EXPECT_EXIT(
      {
        UseByName();
        std::exit(0);
      },
      ::testing::ExitedWithCode(0),
      "");
}

TEST(RegisterRule, MakesARuleKnownToTheCallback) {
  EXPECT_EXIT(
      {
        UseInsideCeres();
        std::exit(0);
      },
      ::testing::ExitedWithCode(0),
      "");
}

TEST(RegisterRuleDeathTest, ChecksNameAndRow) {
  EXPECT_DEATH(RegisterRule<Plain>("adam", ""), "already a rule 'adam'");
  for (const char* name :
       {"", "a b", "a:b", "a=b", "a,b", "a/b", "a+b", "a>b"}) {
    EXPECT_DEATH(RegisterRule<Plain>(name, ""), "cannot be the name") << name;
  }
  RuleRow incomplete;
  incomplete.name = "incomplete";
  EXPECT_DEATH(RegisterRule(incomplete), "incomplete");
}

TEST(MakeRule, DiesWithTheMessageOfTheOther) {
  std::string error;
  EXPECT_EQ(MakeRule("half_invers:step_size=auto", &error), nullptr);
  EXPECT_EQ(error, "unknown rule 'half_invers'; did you mean half_inverse?");
  EXPECT_DEATH(MakeRule("half_invers:step_size=auto"),
               "unknown rule 'half_invers'; did you mean half_inverse\\?");
  EXPECT_EQ(MakeRule("adam,rmsprop", &error), nullptr);
  EXPECT_EQ(error, "'adam,rmsprop' describes 2 rules; expected one");
  EXPECT_EQ(MakeRule("adam:", &error), nullptr);
  EXPECT_EQ(error,
            "'' in 'adam:' has no '='; expected name:key=value:key=value");
}

}  // namespace register_rule_test
}  // namespace invgrad
