#include "invgrad/option_set.h"

#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"

namespace invgrad {
namespace option_set_test {

using Names = std::vector<std::string>;
using Settings = std::vector<std::pair<std::string, std::string>>;

struct Fields {
  std::optional<double> step_size = 1.0;
  double decay = 0.9;
  double tau = 1e-6;
  int depth = 3;
  bool nesterov = false;
  std::string activation = "tanh";

  void Describe(OptionSet* set) {
    set->Add("step_size",
             &step_size,
             {0.0, std::numeric_limits<double>::infinity(), true},
             "eta");
    set->Add("decay", &decay, {0.0, 1.0, true}, "memory");
    set->Add("tau", &tau, {0.0, 1.0, false, true}, "truncation");
    set->Add("depth",
             &depth,
             {1.0, std::numeric_limits<double>::infinity()},
             "layers");
    set->Add("nesterov", &nesterov, "look ahead");
    set->Add("activation", &activation, {"tanh", "relu"}, "neuron");
  }
};

class OptionSetTest : public ::testing::Test {
 protected:
  OptionSetTest() { fields_.Describe(&set_); }

  // The message of a setting that must be refused.
  std::string Refusal(const std::string& name, const std::string& value) {
    std::string error;
    EXPECT_FALSE(set_.Set(name, value, &error)) << name << "=" << value;
    return error;
  }
  void ExpectAccepted(const std::string& name, const std::string& value) {
    std::string error;
    EXPECT_TRUE(set_.Set(name, value, &error)) << error;
  }

  Fields fields_;
  OptionSet set_;
};

TEST_F(OptionSetTest, RowsHoldDefaultsAndWhatIsAllowed) {
  const std::vector<OptionSet::Row>& rows = set_.rows();
  ASSERT_EQ(rows.size(), 6u);
  const std::vector<Names> expected = {
      {"step_size", "1", "(0, inf) or auto", "eta"},
      {"decay", "0.9", "(0, 1]", "memory"},
      {"tau", "1e-06", "[0, 1)", "truncation"},
      {"depth", "3", "integer in [1, inf)", "layers"},
      {"nesterov", "false", "true or false", "look ahead"},
      {"activation", "tanh", "one of tanh, relu", "neuron"}};
  for (size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ((Names{rows[i].name,
                     rows[i].default_value,
                     rows[i].allowed,
                     rows[i].help}),
              expected[i]);
  }
}

TEST_F(OptionSetTest, SetsEveryType) {
  ExpectAccepted("step_size", "3e-4");
  EXPECT_EQ(fields_.step_size, 3e-4);
  ExpectAccepted("step_size", "auto");
  EXPECT_EQ(fields_.step_size, std::nullopt);
  ExpectAccepted("tau", "0");
  EXPECT_EQ(fields_.tau, 0.0);
  ExpectAccepted("depth", "12");
  EXPECT_EQ(fields_.depth, 12);
  ExpectAccepted("nesterov", "true");
  EXPECT_TRUE(fields_.nesterov);
  ExpectAccepted("nesterov", "false");
  EXPECT_FALSE(fields_.nesterov);
  ExpectAccepted("activation", "relu");
  EXPECT_EQ(fields_.activation, "relu");
}

TEST_F(OptionSetTest, EndsOfARange) {
  ExpectAccepted("decay", "1");
  EXPECT_EQ(Refusal("decay", "0"), "decay=0 is out of range; allowed: (0, 1]");
  EXPECT_EQ(Refusal("tau", "1"), "tau=1 is out of range; allowed: [0, 1)");
  EXPECT_EQ(Refusal("tau", "-1e-300"),
            "tau=-1e-300 is out of range; allowed: [0, 1)");
  EXPECT_EQ(Refusal("depth", "0"),
            "depth=0 is out of range; allowed: integer in [1, inf)");
}

TEST_F(OptionSetTest, RefusalNamesOptionValueAndRange) {
  EXPECT_EQ(Refusal("step_size", "-1"),
            "step_size=-1 is out of range; allowed: (0, inf) or auto");
  EXPECT_EQ(Refusal("activation", "sine"),
            "activation=sine is no choice; allowed: one of tanh, relu");
  EXPECT_EQ(Refusal("nesterov", "yes"),
            "nesterov=yes is neither true nor false; allowed: true or false");
}

TEST_F(OptionSetTest, RefusesWhatIsNotExactlyOneNumber) {
  for (const char* text : {"1e-3x",
                           "nan",
                           "-nan",
                           "inf",
                           "infinity",
                           "",
                           " 1",
                           "1 ",
                           "0x10",
                           "1,5",
                           "Auto"}) {
    EXPECT_EQ(Refusal("step_size", text),
              std::string("step_size=") + text +
                  " is not a finite number; allowed: (0, inf) or auto");
  }
  for (const char* text : {"3.0", "3x", "", "1e2"}) {
    EXPECT_EQ(Refusal("depth", text),
              std::string("depth=") + text +
                  " is not an integer; allowed: integer in [1, inf)");
  }
  EXPECT_EQ(Refusal("step_size", "1e999"),
            "step_size=1e999 is out of a double's range; allowed: (0, inf) or "
            "auto");
  EXPECT_EQ(Refusal("depth", "2147483648"),
            "depth=2147483648 is out of the range of 32 bits; allowed: integer "
            "in [1, inf)");
  // Only step_size may be found automatically.
  EXPECT_EQ(Refusal("decay", "auto"),
            "decay=auto is not a finite number; allowed: (0, 1]");
}

TEST_F(OptionSetTest, ARefusedValueLeavesTheFieldAlone) {
  Refusal("step_size", "-2");
  Refusal("depth", "7x");
  Refusal("activation", "");
  EXPECT_EQ(fields_.step_size, 1.0);
  EXPECT_EQ(fields_.depth, 3);
  EXPECT_EQ(fields_.activation, "tanh");
}

TEST_F(OptionSetTest, UnknownOptionGetsTheNearestNames) {
  EXPECT_EQ(Refusal("step_siz", "1"),
            "unknown option 'step_siz'; did you mean step_size?");
  EXPECT_EQ(Refusal("zzzzzzzz", "1"),
            "unknown option 'zzzzzzzz'; known: step_size, decay, tau, depth, "
            "nesterov, activation");
}

TEST_F(OptionSetTest, SetAllStopsAtTheFirstErrorAndRefusesRepetition) {
  std::string error;
  EXPECT_TRUE(set_.SetAll({{"decay", "0.5"}, {"depth", "2"}}, &error));
  EXPECT_EQ(fields_.decay, 0.5);
  EXPECT_EQ(fields_.depth, 2);
  EXPECT_FALSE(set_.SetAll({{"decay", "0.25"}, {"decay", "0.5"}}, &error));
  EXPECT_EQ(error, "decay is given twice: 0.25 and 0.5");
  EXPECT_FALSE(set_.SetAll({{"decay", "2"}, {"depth", "5"}}, &error));
  EXPECT_EQ(error, "decay=2 is out of range; allowed: (0, 1]");
  EXPECT_EQ(fields_.depth, 2);
}

TEST(OptionSetDeathTest, BugsInADescriptionAreChecked) {
  OptionSet set;
  double field = 2.0;
  EXPECT_DEATH(set.Add("x", &field, {0.0, 1.0}, ""), "x=2 is out of range");
  set.Add("x", &field, {0.0, 2.0}, "");
  EXPECT_DEATH(set.Add("x", &field, {0.0, 2.0}, ""), "added twice");
}

// 1e+05 would be no integer.
TEST(OptionSet, PrintsLimitsOfIntegersAsIntegers) {
  int count = 1;
  double factor = 1.0;
  OptionSet set;
  set.Add("count", &count, {1.0, 1e5}, "");
  set.Add("factor", &factor, {1.0, 1e5}, "");
  EXPECT_EQ(set.rows()[0].allowed, "integer in [1, 100000]");
  EXPECT_EQ(set.rows()[1].allowed, "[1, 1e+05]");
}

}  // namespace option_set_test
}  // namespace invgrad
