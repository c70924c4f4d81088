#include "invgrad/core/specification.h"

#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"

namespace invgrad {
namespace specification_test {

using Names = std::vector<std::string>;

TEST(ParseSpecifications, SplitsNamesAndSettings) {
  std::vector<Specification> specifications;
  std::string error;
  ASSERT_TRUE(ParseSpecifications(
      "adam:step_size=3e-4 : beta1=0.8, half_inverse,lm:a=b=c",
      &specifications,
      &error));
  ASSERT_EQ(specifications.size(), 3u);
  EXPECT_EQ(specifications[0].text, "adam:step_size=3e-4 : beta1=0.8");
  EXPECT_EQ(specifications[0].name, "adam");
  EXPECT_EQ(specifications[0].settings,
            (Settings{{"step_size", "3e-4"}, {"beta1", "0.8"}}));
  EXPECT_EQ(specifications[1].name, "half_inverse");
  EXPECT_TRUE(specifications[1].settings.empty());
  EXPECT_EQ(specifications[2].settings, (Settings{{"a", "b=c"}}));
}

TEST(ParseSpecifications, RefusesWithThePlaceOfTheError) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"",
       "'' (number 1 of '') does not start with a name; expected "
       "name:key=value:key=value"},
      {"a,,b",
       "'' (number 2 of 'a,,b') does not start with a name; expected "
       "name:key=value:key=value"},
      {"a,x=1",
       "'x=1' (number 2 of 'a,x=1') does not start with a name; expected "
       "name:key=value:key=value"},
      {"a:x", "'x' in 'a:x' has no '='; expected name:key=value:key=value"},
      {"a:", "'' in 'a:' has no '='; expected name:key=value:key=value"},
      {"a:=1", "'=1' in 'a:=1' has no key; expected name:key=value:key=value"}};
  for (const auto& [text, message] : cases) {
    std::vector<Specification> specifications(1);
    std::string error;
    EXPECT_FALSE(ParseSpecifications(text, &specifications, &error)) << text;
    EXPECT_EQ(error, message);
    EXPECT_EQ(specifications.size(), 1u) << "changed on failure";
  }
}

TEST(UnknownNameMessage, NamesAreSortedByDistanceAndLimited) {
  const auto message = [](const std::string& name, const Names& known) {
    return UnknownNameMessage("rule", name, known);
  };
  const Names names = {"adagrad", "adadelta", "adam", "rmsprop", "newton"};
  EXPECT_EQ(message("adma", names), "unknown rule 'adma'; did you mean adam?");
  EXPECT_EQ(message("adamgrad", names),
            "unknown rule 'adamgrad'; did you mean adagrad?");
  const std::string known = "known: adagrad, adadelta, adam, rmsprop, newton";
  EXPECT_EQ(message("levenberg", names), "unknown rule 'levenberg'; " + known);
  EXPECT_EQ(message("", names), "unknown rule ''; " + known);
  EXPECT_EQ(message("ab", {"aa", "b", "a", "ab", "abc"}),
            "unknown rule 'ab'; did you mean ab, aa or b?");
}

TEST(UnknownNameMessage, ListsTheAlternatives) {
  EXPECT_EQ(UnknownNameMessage("rule", "adm", {"adam", "newton"}),
            "unknown rule 'adm'; did you mean adam?");
  EXPECT_EQ(UnknownNameMessage("rule", "ab", {"aa", "b", "a"}),
            "unknown rule 'ab'; did you mean aa, b or a?");
  EXPECT_EQ(UnknownNameMessage("rule", "q", {"newton", "adam"}),
            "unknown rule 'q'; known: newton, adam");
}

TEST(Printable, EscapesAndCuts) {
  EXPECT_EQ(Printable("a b~"), "a b~");
  EXPECT_EQ(Printable("\x1b[31m\n\x7f\xc3"), "\\x1b[31m\\x0a\\x7f\\xc3");
  EXPECT_EQ(Printable("abc", 3), "abc");
  EXPECT_EQ(Printable("abcd", 3), "abc...");
  EXPECT_EQ(Printable(std::string(1000, 'x')), std::string(200, 'x') + "...");
}

}  // namespace specification_test
}  // namespace invgrad
