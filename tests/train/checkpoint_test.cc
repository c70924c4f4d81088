#include "invgrad/train/checkpoint.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace {

using Eigen::VectorXd;

class CheckpointTest : public testing::Test {
 protected:
  std::string ReadError(const std::string& bytes) {
    std::string error;
    EXPECT_TRUE(WriteFile(path_, bytes, &error)) << error;
    Checkpoint checkpoint;
    checkpoint.arrays["kept"] = VectorXd::Ones(1);
    EXPECT_FALSE(ReadCheckpoint(path_, &checkpoint, &error));
    EXPECT_EQ(checkpoint.arrays.count("kept"), 1u) << "output was changed";
    const std::string start = "file " + path_ + ": ";
    EXPECT_EQ(error.substr(0, start.size()), start);
    return error.substr(std::min(start.size(), error.size()));
  }

  // A file with one array of size 1, but for what is written there.
  std::string Bytes(const std::string& count, const std::string& line) {
    return magic_ + count + "\n" + line + "\n" + std::string(8, '\0');
  }

  const TemporaryFolder folder_;
  const std::string path_ = folder_ / "checkpoint";
  const std::string magic_ = "invgrad checkpoint, version 1\n";
};

TEST_F(CheckpointTest, RoundTripIsBitForBit) {
  Checkpoint checkpoint;
  VectorXd special(6);
  special << -0.0, std::numeric_limits<double>::infinity(),
      std::numeric_limits<double>::denorm_min(), 0.1,
      std::numeric_limits<double>::max(), std::nan("7");
  checkpoint.arrays["special"] = special;
  checkpoint.arrays["adam.m"] = VectorXd::LinSpaced(1000, -1.0, 2.0);
  checkpoint.arrays["empty"] = VectorXd();
  std::string error;
  ASSERT_TRUE(WriteCheckpoint(path_, checkpoint, &error)) << error;
  Checkpoint back;
  back.arrays["old"] = special;
  ASSERT_TRUE(ReadCheckpoint(path_, &back, &error)) << error;
  ASSERT_EQ(back.arrays.size(), 3u);
  for (const auto& [name, array] : checkpoint.arrays) {
    const VectorXd& found = back.arrays.at(name);
    ASSERT_EQ(found.size(), array.size()) << name;
    EXPECT_TRUE(
        std::equal(reinterpret_cast<const char*>(array.data()),
                   reinterpret_cast<const char*>(array.data() + array.size()),
                   reinterpret_cast<const char*>(found.data())))
        << name;
  }
}

TEST_F(CheckpointTest, NoArraysAreACheckpointToo) {
  std::string error;
  ASSERT_TRUE(WriteCheckpoint(path_, Checkpoint(), &error)) << error;
  Checkpoint back;
  back.arrays["old"] = VectorXd::Ones(1);
  ASSERT_TRUE(ReadCheckpoint(path_, &back, &error)) << error;
  EXPECT_TRUE(back.arrays.empty());
}

TEST_F(CheckpointTest, TheLayoutIsTheDocumentedOne) {
  Checkpoint checkpoint;
  checkpoint.arrays["b"] = VectorXd::Constant(1, 2.0);
  checkpoint.arrays["a"] = VectorXd::Constant(1, 1.0);
  std::string error;
  std::string bytes;
  ASSERT_TRUE(WriteCheckpoint(path_, checkpoint, &error)) << error;
  ASSERT_TRUE(ReadFile(path_, &bytes, &error)) << error;
  // 1.0 is 3ff0000000000000, 2.0 is 4000000000000000.
  EXPECT_EQ(bytes,
            magic_ + "2\na 1\nb 1\n" + std::string(6, '\0') + "\xf0\x3f" +
                std::string(7, '\0') + "\x40");
}

TEST_F(CheckpointTest, EveryTruncationAndEveryExtraByteIsReported) {
  Checkpoint checkpoint;
  checkpoint.arrays["theta"] = VectorXd::Ones(3);
  checkpoint.arrays["v"] = VectorXd::Ones(2);
  std::string error;
  std::string bytes;
  ASSERT_TRUE(WriteCheckpoint(path_, checkpoint, &error)) << error;
  ASSERT_TRUE(ReadFile(path_, &bytes, &error)) << error;
  for (size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_NE(ReadError(bytes.substr(0, size)), "") << size << " bytes";
  }
  EXPECT_EQ(ReadError(bytes + '\0'), "found 41 bytes of values, wanted 40");
}

TEST_F(CheckpointTest, ErrorsSayWhat) {
  const std::string one(8, '\0');
  EXPECT_EQ(
      ReadError("hello\n"),
      "not a checkpoint (it does not begin with 'invgrad checkpoint, version "
      "')");
  EXPECT_EQ(ReadError("invgrad checkpoint, version 2\n0\n"),
            "found version '2', wanted '1'");
  for (const std::string count : {"", "-1", "1.0", "x", "1 "}) {
    EXPECT_EQ(ReadError(Bytes(count, "a 1")),
              "cannot read the number of arrays");
  }
  EXPECT_EQ(ReadError(magic_ + "2\na 1\n" + one),
            "array 2 of 2: no line with its name and size (truncated?)");
  for (const std::string line : {"a", "a ", " 1", "a -1", "a 1.0", "a b 1"}) {
    EXPECT_EQ(ReadError(Bytes("1", line)),
              "array 1 of 1: found '" + line + "', wanted name and size");
  }
  EXPECT_EQ(ReadError(magic_ + "2\na 1\na 1\n" + one + one),
            "array 2 of 2: a second 'a'");
}

TEST_F(CheckpointTest, LyingSizesDoNotAllocate) {
  const std::string one(8, '\0');
  // 2^61 doubles are 2^64 bytes, zero modulo 2^64.
  for (const std::string size :
       {"2", "1000000000000", "2305843009213693952", "18446744073709551615"}) {
    EXPECT_EQ(ReadError(Bytes("1", "a " + size)),
              "array 1 of 1: 'a' has " + size +
                  " values, the file is too short for them (truncated?)");
  }
  EXPECT_EQ(ReadError(magic_ + "2\na 1\nb 18446744073709551615\n" + one),
            "array 2 of 2: 'b' has 18446744073709551615 values, the file is "
            "too short for them (truncated?)");
  EXPECT_EQ(ReadError(magic_ + "18446744073709551615\na 1\n"),
            "array 1 of 18446744073709551615: 'a' has 1 values, the file is "
            "too short for them (truncated?)");
}

TEST_F(CheckpointTest, MissingFolderAndFileAreReported) {
  const std::string path = folder_ / "none/checkpoint";
  std::string error;
  EXPECT_FALSE(WriteCheckpoint(path, Checkpoint(), &error));
  EXPECT_EQ(error, "cannot write " + path + ": No such file or directory");
  Checkpoint checkpoint;
  EXPECT_FALSE(ReadCheckpoint(path, &checkpoint, &error));
  EXPECT_EQ(error, "cannot read " + path + ": No such file or directory");
}

TEST_F(CheckpointTest, NamesWithWhiteSpaceAreABug) {
  std::string error;
  for (const std::string name : {"", "a b", "a\n"}) {
    Checkpoint checkpoint;
    checkpoint.arrays[name] = VectorXd();
    EXPECT_DEATH(WriteCheckpoint(path_, checkpoint, &error), "name");
  }
}

}  // namespace
}  // namespace invgrad
