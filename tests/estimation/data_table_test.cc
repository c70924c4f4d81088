#include "problems/estimation/data_table.h"

#include <string>
#include <vector>

#include "gtest/gtest.h"

namespace invgrad {
namespace data_table_test {

DataTable Parsed(const std::string& text) {
  DataTable table;
  std::string error;
  EXPECT_TRUE(ParseTable(text, "f", &table, &error)) << text << ": " << error;
  return table;
}

Eigen::VectorXd ColumnOf(const DataTable& table, const std::string& name) {
  Eigen::VectorXd values;
  std::string error;
  EXPECT_TRUE(ReadColumn(table, table.FindColumn(name), "f", &values, &error))
      << error;
  return values;
}

TEST(DataTable, ReadsEverySeparator) {
  for (const std::string text :
       {"t,y\n1,2.5\n3,-4e-1\n",
        "t;y\n1;2.5\n3;-4e-1",
        "t\ty\n1\t2.5\n3\t-4e-1\n",
        "  t   y\n 1  2.5 \n3 \t-4e-1\n",
        "\"t\", \"y\"\r\n 1, 2.5\r\n+3, -.4\r\n",
        "\xEF\xBB\xBF# x\n\nt,y\n1,2.5\n# x\n\n3,-.4"}) {
    SCOPED_TRACE(text);
    const DataTable table = Parsed(text);
    EXPECT_EQ(table.names, (std::vector<std::string>{"t", "y"}));
    EXPECT_EQ(ColumnOf(table, "t"), Eigen::Vector2d(1.0, 3.0));
    EXPECT_EQ(ColumnOf(table, "y"), Eigen::Vector2d(2.5, -0.4));
    const DataTable back = Parsed(TableText(table));
    EXPECT_EQ(back.names, table.names);
    EXPECT_EQ(back.rows, table.rows);
  }
}

TEST(DataTable, NumbersColumnsThatHaveNoUsableName) {
  DataTable table = Parsed("1 2\n3 4\n");
  EXPECT_EQ(ColumnOf(table, "c2"), Eigen::Vector2d(2.0, 4.0));
  EXPECT_EQ(table.FindColumn("c3"), -1);
  EXPECT_EQ(table.FindColumn("y"), -1);
  table = Parsed("time (s),y\n1,2\n3,4\n");
  EXPECT_EQ(ColumnOf(table, "c1"), Eigen::Vector2d(1.0, 3.0));
  // It may be a parameter.
  EXPECT_EQ(table.FindColumn("c2"), -1);
}

// A missing value in the first row does not make it a row of names.
TEST(DataTable, OneNumberMakesARowOfData) {
  for (const std::string text : {"1,2,--\n3,4,5\n", "1,2,\n3,4,5\n"}) {
    const DataTable table = Parsed(text);
    EXPECT_EQ(table.names, (std::vector<std::string>{"c1", "c2", "c3"}));
    EXPECT_EQ(ColumnOf(table, "c2"), Eigen::Vector2d(2.0, 4.0));
    Eigen::VectorXd values;
    std::string error;
    EXPECT_FALSE(ReadColumn(table, 2, "f", &values, &error));
    EXPECT_EQ(error.find("f:1: found '"), 0u) << error;
  }
}

TEST(DataTable, SeveralColumnsMayHaveNoName) {
  const DataTable table = Parsed("t,y,,,a (m),a (m)\n1,2,3,4,5,6\n");
  EXPECT_EQ(ColumnOf(table, "c4")[0], 4.0);
  EXPECT_EQ(ColumnOf(table, "c6")[0], 6.0);
}

TEST(DataTable, QuotesKeepSeparators) {
  for (const std::string text :
       {"day,\"a \"\"b\"\", c;\",y\n\"Jan 1, 2020\",x,3\n\"#\", \"\" ,4\n",
        "day;\"a \"\"b\"\", c;\";y\n\"Jan 1, 2020\";x;3\n\"#\"; \"\" ;4\n",
        "day\t\"a \"\"b\"\", c;\"\ty\n\"Jan 1, 2020\"\tx\t3\n\"#\"\t\"\"\t4\n",
        "day \"a \"\"b\"\", c;\" y\n\"Jan 1, 2020\" x 3\n\"#\" \"\" 4\n"}) {
    SCOPED_TRACE(text);
    const DataTable table = Parsed(text);
    EXPECT_EQ(table.names,
              (std::vector<std::string>{"day", "a \"b\", c;", "y"}));
    ASSERT_EQ(table.rows.size(), 2u);
    EXPECT_EQ(table.rows[0][0], "Jan 1, 2020");
    EXPECT_EQ(table.rows[1][0], "#");
    EXPECT_EQ(table.rows[1][1], "");
    EXPECT_EQ(ColumnOf(table, "y"), Eigen::Vector2d(3.0, 4.0));
    const DataTable back = Parsed(TableText(table));
    EXPECT_EQ(back.separator, table.separator);
    EXPECT_EQ(back.names, table.names);
    EXPECT_EQ(back.rows, table.rows);
  }
  // No quotes around the cell.
  const DataTable inches = Parsed("pipe,y\n5\",\"3\n");
  EXPECT_EQ(inches.rows[0], (std::vector<std::string>{"5\"", "\"3"}));
}

TEST(DataTable, CellsBetweenTabsMayBeEmpty) {
  for (const std::string text : {"x\ty\tnote\n1\t2\tok\n3\t4\t\n",
                                 "note\tx\ty\r\nok\t1\t2\r\n\t3\t4\r\n",
                                 "\tx\ty\n0\t1\t2\n1\t3\t4\n",
                                 "x\ty\t\n1\t2\t\n3\t4\t\n"}) {
    SCOPED_TRACE(text);
    const DataTable table = Parsed(text);
    EXPECT_EQ(table.names.size(), 3u);
    EXPECT_EQ(ColumnOf(table, "x"), Eigen::Vector2d(1.0, 3.0));
    EXPECT_EQ(ColumnOf(table, "y"), Eigen::Vector2d(2.0, 4.0));
    const DataTable back = Parsed(TableText(table));
    EXPECT_EQ(back.names, table.names);
    EXPECT_EQ(back.rows, table.rows);
  }
  // An index without a name.
  EXPECT_EQ(ColumnOf(Parsed("\ty\n0\t2\n1\t4\n"), "y"),
            Eigen::Vector2d(2.0, 4.0));
  // Tabs around some rows, or around rows of numbers alone, are no cells.
  EXPECT_EQ(ColumnOf(Parsed("\t1\t2\n\t3\t4\n"), "c2"),
            Eigen::Vector2d(2.0, 4.0));
  EXPECT_EQ(ColumnOf(Parsed("x\ty\n\t1\t2\n3\t4\t\n"), "y"),
            Eigen::Vector2d(2.0, 4.0));
  DataTable written;
  written.separator = '\t';
  written.names = {"", "y"};
  written.rows = {{"", ""}, {"", "#"}, {"1", ""}};
  const DataTable back = Parsed(TableText(written));
  EXPECT_EQ(back.names, written.names);
  EXPECT_EQ(back.rows, written.rows);
}

TEST(DataTable, NewNamesAreNotThere) {
  const DataTable table = Parsed("x,fit,fit_2\n1,2,3\n");
  EXPECT_EQ(table.NewName("fit"), "fit_3");
  EXPECT_EQ(table.NewName("residual"), "residual");
}

// Columns of texts are no error unless they are used.
TEST(DataTable, SaysWhichCellIsNoNumber) {
  const DataTable table = Parsed("name,y\n# x\nfirst,1\nsecond,NA\nthird,\n");
  EXPECT_EQ(table.rows.size(), 3);
  Eigen::VectorXd values;
  std::string error;
  EXPECT_FALSE(ReadColumn(table, 1, "d/f.csv", &values, &error));
  EXPECT_EQ(error,
            "d/f.csv:4: found 'NA' in the column y; expected a finite number");
}

TEST(DataTable, SaysWhatIsWrongAndWhere) {
  struct Case {
    const char* text;
    const char* message;
  };
  for (const Case& bad :
       {Case{"", "f:1: the text is empty; expected a row of numbers"},
        {"t,y\n", "f:1: the text ends; expected a row of numbers"},
        {"t,y\n1,2\n3\n",
         "f:3: the row has 1 cells; expected 2, as the first row"},
        {"1,2\n3,4,5\n",
         "f:2: the row has 3 cells; expected 2, as the first row"},
        {"y,y\n1,2\n",
         "f:1: two columns are called 'y'; expected another name for each"},
        {"x,pi\n1,2\n",
         "f:1: a column is called 'pi', as the number in formulas; expected "
         "another name for each"}}) {
    DataTable table;
    std::string error;
    EXPECT_FALSE(ParseTable(bad.text, "f", &table, &error)) << bad.text;
    EXPECT_EQ(error, bad.message);
    EXPECT_TRUE(table.names.empty());
  }
}

}  // namespace data_table_test
}  // namespace invgrad
