#include "bin/support/csv_field.h"

#include "gtest/gtest.h"

namespace invgrad {
namespace csv_field_test {

TEST(CsvField, IsQuotedWhereItMustBe) {
  EXPECT_EQ(CsvField(""), "");
  EXPECT_EQ(CsvField("adam:step_size=1e-3"), "adam:step_size=1e-3");
  EXPECT_EQ(CsvField("a, b"), "\"a, b\"");
  EXPECT_EQ(CsvField("a\nb"), "\"a\nb\"");
  EXPECT_EQ(CsvField("\"a\" b"), "\"\"\"a\"\" b\"");
}

}  // namespace csv_field_test
}  // namespace invgrad
