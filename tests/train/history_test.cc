#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/train.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace history_test {

// Also the sign of zero; any NaN is like any other.
bool IsSame(double a, double b) {
  return (std::isnan(a) && std::isnan(b)) ||
         (a == b && std::signbit(a) == std::signbit(b));
}

void ExpectSame(const History& found, const History& wanted) {
  ASSERT_EQ(found.size(), wanted.size());
  for (size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].step, wanted[i].step);
    for (const HistoryColumn& column : kHistoryColumns) {
      EXPECT_TRUE(IsSame(found[i].*column.value, wanted[i].*column.value))
          << "row " << i << " column " << column.name;
    }
  }
}

class HistoryTest : public testing::Test {
 protected:
  std::string ReadError(const std::string& text) {
    std::string error;
    EXPECT_TRUE(WriteFile(path_, text, &error)) << error;
    History history(3);
    EXPECT_FALSE(ReadHistory(path_, &history, &error));
    EXPECT_EQ(history.size(), 3u) << "output was changed";
    const std::string start = "file " + path_ + ", ";
    EXPECT_EQ(error.substr(0, start.size()), start);
    return error.substr(std::min(start.size(), error.size()));
  }

  const TemporaryFolder folder_;
  const std::string path_ = folder_ / "history.csv";
  const std::string header_ =
      "step,epoch,seconds,batch_loss,train_loss,test_loss,step_norm,metric,"
      "by_inverse,by_numerical_inverse,by_inverse_gradient,by_gradient,"
      "not_moved,batch_size,simulator_calls\n";
};

TEST_F(HistoryTest, WritesTheDocumentedText) {
  History history(2);
  history[0].train_loss = 0.25;
  history[0].test_loss = 0.26;
  history[1].step = 16;
  history[1].epoch = 0.5;
  history[1].seconds = 0.1;
  history[1].batch_loss = 1.5e-3;
  history[1].step_norm = std::numeric_limits<double>::infinity();
  history[1].metric = 0.5;
  history[1].by_numerical_inverse = 3;
  history[1].batch_size = 32;
  history[1].simulator_calls = 1024;
  std::string error;
  std::string text;
  ASSERT_TRUE(WriteHistory(path_, history, &error)) << error;
  ASSERT_TRUE(ReadFile(path_, &text, &error)) << error;
  EXPECT_EQ(text,
            header_ +
                "0,0,0,,0.25,0.26,,,,,,,,,\n"
                "16,0.5,0.1,0.0015,,,inf,0.5,,3,,,,32,1024\n");
}

TEST_F(HistoryTest, RoundTripIsExact) {
  History history(3);
  history[0].step = std::numeric_limits<long>::max();
  history[0].epoch = 1.0 / 3.0;
  history[0].seconds = 0.1 + 0.2;
  history[0].batch_loss = std::numeric_limits<double>::denorm_min();
  history[0].train_loss = std::numeric_limits<double>::max();
  history[0].test_loss = std::nextafter(1.0, 2.0);
  history[0].step_norm = -0.0;
  history[1].step = std::numeric_limits<long>::min();
  history[1].train_loss = -std::numeric_limits<double>::infinity();
  history[2].epoch = HistoryRow::kNone;
  for (const History& wanted : {History(), history}) {
    std::string error;
    History found(7);
    ASSERT_TRUE(WriteHistory(path_, wanted, &error)) << error;
    ASSERT_TRUE(ReadHistory(path_, &found, &error)) << error;
    ExpectSame(found, wanted);
  }
}

TEST_F(HistoryTest, ErrorsNameFileAndLine) {
  EXPECT_EQ(
      ReadError(""),
      "line 1: wanted the header " + header_.substr(0, header_.size() - 1));
  EXPECT_EQ(
      ReadError("step,epoch\n"),
      "line 1: wanted the header " + header_.substr(0, header_.size() - 1));
  const std::string row = "1,2,3,4,5,6,7,8,9,10,11,12,13,14,15\n";
  EXPECT_EQ(ReadError(header_ + row + "1,2,3,4,5,6\n"),
            "line 3: found 6 fields, wanted 15");
  EXPECT_EQ(
      ReadError(header_ + row + "1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16\n"),
      "line 3: found 16 fields, wanted 15");
  EXPECT_EQ(ReadError(header_ + "\n" + row),
            "line 2: found 1 fields, wanted 15");
  EXPECT_EQ(ReadError(header_ + "1.5,2,3,4,5,6,7,8,9,10,11,12,13,14,15\n"),
            "line 2: found '1.5', wanted a number");
  EXPECT_EQ(ReadError(header_ + ",2,3,4,5,6,7,8,9,10,11,12,13,14,15\n"),
            "line 2: found '', wanted a number");
  EXPECT_EQ(
      ReadError(header_ + row + row + "1,2,3,4,5,6,7,8,9,10,11,12,13,14,15e\n"),
      "line 4: found '15e', wanted a number");
  EXPECT_EQ(ReadError(header_ + "1,2,3, 4,5,6,7,8,9,10,11,12,13,14,15\n"),
            "line 2: found ' 4', wanted a number");
}

TEST_F(HistoryTest, ALineThatDoesNotEndIsTruncated) {
  EXPECT_EQ(
      ReadError(header_ +
                "1,2,3,4,5,6,7,8,9,10,11,12,13,14,15\n2,3,4,5,6,7,8,9,0.12"),
      "line 3: the line does not end (truncated?)");
  EXPECT_EQ(ReadError(header_.substr(0, header_.size() - 1)),
            "line 1: the line does not end (truncated?)");
}

TEST_F(HistoryTest, MissingFolderAndFileAreReported) {
  const std::string path = folder_ / "none/history.csv";
  std::string error;
  EXPECT_FALSE(WriteHistory(path, History(), &error));
  EXPECT_EQ(error, "cannot write " + path + ": No such file or directory");
  History history;
  EXPECT_FALSE(ReadHistory(path, &history, &error));
  EXPECT_EQ(error, "cannot read " + path + ": No such file or directory");
}

}  // namespace history_test
}  // namespace invgrad
