#include "report/table.h"

#include <cmath>

#include "gtest/gtest.h"

namespace invgrad {
namespace table_test {

Table Example() {
  Table table({{"rule", Table::Align::kLeft},
               {"ms/step"},
               {"status", Table::Align::kLeft}});
  table.AddRow({"half_inverse", "1.1", "ok"});
  table.AddRow({"gauss_newton", "12.5", "diverged"});
  return table;
}

TEST(Table, TextIsAligned) {
  EXPECT_EQ(Example().ToText(),
            "rule          ms/step  status\n"
            "------------  -------  --------\n"
            "half_inverse      1.1  ok\n"
            "gauss_newton     12.5  diverged\n");
}

TEST(Table, Markdown) {
  EXPECT_EQ(Example().ToMarkdown(),
            "| rule | ms/step | status |\n"
            "| :--- | ---: | :--- |\n"
            "| half_inverse | 1.1 | ok |\n"
            "| gauss_newton | 12.5 | diverged |\n");
}

TEST(Table, WidthsCountCharactersNotBytes) {
  Table table({{"κ", Table::Align::kLeft}, {"η"}});
  table.AddRow({"½", "1"});
  table.AddRow({"ab", "10"});
  EXPECT_EQ(table.ToText(),
            "κ    η\n"
            "--  --\n"
            "½    1\n"
            "ab  10\n");
}

TEST(Table, CellsThatWouldBreakTheTable) {
  Table table({{"a|b", Table::Align::kLeft}});
  table.AddRow({"two\nlines|"});
  table.AddRow({""});
  EXPECT_EQ(table.ToText(), "a|b\n----------\ntwo lines|\n\n");
  EXPECT_EQ(table.ToMarkdown(),
            "| a\\|b |\n| :--- |\n| two lines\\| |\n|  |\n");
}

TEST(Table, CsvQuotesWhereItMust) {
  Table table({{"a, b"}, {"c"}});
  table.AddRow({"adam:step_size=1e-3", ""});
  table.AddRow({"\"a\" b", "1"});
  EXPECT_EQ(table.ToCsv(),
            "\"a, b\",c\nadam:step_size=1e-3,\n\"\"\"a\"\" b\",1\n");
}

TEST(Table, TheFirstRowMakesTheColumns) {
  Table table;
  EXPECT_EQ(table.ToText(), "\n\n");
  for (const double x : {1.0 / 3.0, std::nan("")}) {
    table.BeginRow();
    table.Add("x", NumberOrDash(x));
    table.Add("all digits", ExactNumber(x), Table::Align::kLeft);
  }
  EXPECT_EQ(table.ToText(),
            "     x  all digits\n------  -------------------\n"
            "0.3333  0.33333333333333331\n     -  nan\n");
  table.BeginRow();
  EXPECT_DEATH(table.Add("y", ""), "title");
  EXPECT_DEATH(table.BeginRow(), "size");
}

TEST(Table, WithoutRows) {
  EXPECT_EQ(Table({{"x"}, {"yy"}}).ToText(), "x  yy\n-  --\n");
}

TEST(Table, WrongNumberOfCellsIsABug) {
  Table table({{"x"}, {"y"}});
  EXPECT_DEATH(table.AddRow({"1"}), "size");
}

}  // namespace table_test
}  // namespace invgrad
