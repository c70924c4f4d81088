#include "invgrad/train/checkpoint.h"

#include <sys/stat.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/digest.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace checkpoint_test {

using Eigen::VectorXd;

// Members of every kind.
struct State {
  VectorXd special;
  VectorXd empty;
  double number = 0.0;
  long count = 0;

  void Visit(StateArchive* archive) {
    archive->Visit("special", &special);
    archive->Visit("empty", &empty);
    archive->set_prefix("run.");
    archive->Visit("number", &number);
    archive->Visit("count", &count);
  }
};

class CheckpointTest : public testing::Test {
 protected:
  // The message for a file of these bytes, without its path.
  std::string ReadError(const std::string& bytes) {
    std::string error;
    EXPECT_TRUE(WriteFile(path_, bytes, &error)) << error;
    error = StateArchive::Read(path_, identity_).error();
    const std::string start = path_ + ": ";
    EXPECT_EQ(error.rfind(start, 0), 0u) << error;
    return error.substr(std::min(start.size(), error.size()));
  }

  // A file with this text after the identity, and its right digest.
  std::string FileWith(const std::string& rest) const {
    const std::string text = identity_.text() + '\n' + rest;
    return magic_ + Digest().Add(text).Hex() + '\n' + text;
  }

  // The bytes of a file of two arrays.
  std::string SmallFile() {
    StateArchive archive;
    VectorXd one = VectorXd::Constant(1, 1.0), two = VectorXd::Constant(1, 2.0);
    archive.Visit("b", &two);
    archive.Visit("a", &one);
    std::string error;
    std::string bytes;
    EXPECT_TRUE(archive.Write(path_, identity_, &error)) << error;
    EXPECT_TRUE(ReadFile(path_, &bytes, &error)) << error;
    return bytes;
  }

  const TemporaryFolder folder_;
  const std::string path_ = folder_ / "checkpoint";
  const RunIdentity identity_;
  const std::string magic_ = "invgrad checkpoint, version 10\n";
  const std::string damaged_ = "the file is truncated or damaged";
};

TEST_F(CheckpointTest, RoundTripIsBitForBit) {
  State state;
  state.special.resize(6);
  state.special << -0.0, std::numeric_limits<double>::infinity(),
      std::numeric_limits<double>::denorm_min(), 0.1,
      std::numeric_limits<double>::max(), std::nan("7");
  state.number = 1.0 / 3.0;
  state.count = 1L << 50;
  StateArchive archive;
  EXPECT_FALSE(archive.is_reading());
  state.Visit(&archive);
  std::string error;
  ASSERT_TRUE(archive.Write(path_, identity_, &error)) << error;

  State back;
  back.empty = VectorXd::Ones(3);
  StateArchive found = StateArchive::Read(path_, identity_);
  EXPECT_TRUE(found.is_reading());
  back.Visit(&found);
  ASSERT_EQ(found.error(), "");
  ASSERT_EQ(back.special.size(), 6);
  // Bit for bit, because NaN and zeros of both signs are among them.
  const auto bytes = [](const VectorXd& values) {
    return std::string(reinterpret_cast<const char*>(values.data()),
                       sizeof(double) * values.size());
  };
  EXPECT_EQ(bytes(back.special), bytes(state.special));
  EXPECT_EQ(back.empty.size(), 0);
  EXPECT_EQ(back.number, state.number);
  EXPECT_EQ(back.count, state.count);
}

TEST_F(CheckpointTest, NoArraysAreACheckpointToo) {
  std::string error;
  ASSERT_TRUE(StateArchive().Write(path_, identity_, &error)) << error;
  EXPECT_EQ(StateArchive::Read(path_, identity_).error(), "");
}

TEST_F(CheckpointTest, TheLayoutIsTheDocumentedOne) {
  // 1.0 is 3ff0000000000000, 2.0 is 4000000000000000.
  EXPECT_EQ(SmallFile(),
            FileWith("2\na 1\nb 1\n" + std::string(6, '\0') + "\xf0\x3f" +
                     std::string(7, '\0') + "\x40"));
}

TEST_F(CheckpointTest, EveryTruncationAndEveryExtraByteIsReported) {
  const std::string bytes = SmallFile();
  for (size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_NE(ReadError(bytes.substr(0, size)), "") << size << " bytes";
  }
  EXPECT_EQ(ReadError(bytes + '\0'), damaged_);
}

TEST_F(CheckpointTest, AFlippedBitInAnyByteIsReported) {
  const std::string bytes = SmallFile();
  for (size_t i = 0; i < bytes.size(); ++i) {
    std::string flipped = bytes;
    flipped[i] = static_cast<char>(flipped[i] ^ (1 << (i % 8)));
    EXPECT_NE(ReadError(flipped), "") << "byte " << i;
  }
}

TEST_F(CheckpointTest, ANulByteEndsNoLine) {
  const std::string bytes = SmallFile();
  const std::string junk("\0junk", 5);
  const size_t end_of_digest = bytes.find('\n', magic_.size());
  std::string changed = bytes;
  EXPECT_EQ(ReadError(changed.insert(end_of_digest, junk)), damaged_);
  changed = bytes;
  EXPECT_EQ(ReadError(changed.insert(magic_.size() - 1, junk)),
            "not of version 10, the one of this program");
}

TEST_F(CheckpointTest, WhatAForeignHeaderHoldsIsPrintable) {
  RunIdentity other;
  other.Add("method", "\x1b[31mred\a");
  std::string error;
  ASSERT_TRUE(StateArchive().Write(path_, other, &error)) << error;
  error = StateArchive::Read(path_, identity_).error();
  EXPECT_NE(error.find("red"), std::string::npos) << error;
  EXPECT_EQ(error.find_first_of("\x1b\a"), std::string::npos) << error;
}

TEST_F(CheckpointTest, ForeignFilesAndOldVersionsAreReported) {
  EXPECT_EQ(ReadError(""), "not a checkpoint");
  EXPECT_EQ(ReadError("hello\n"), "not a checkpoint");
  EXPECT_EQ(ReadError("invgrad checkpoint, version 1\n0\n"),
            "not of version 10, the one of this program");
}

TEST_F(CheckpointTest, DamagedHeadersAreReported) {
  const std::string one(8, '\0');
  for (const std::string header : {"\na 1",
                                   "-1\na 1",
                                   "1.0\na 1",
                                   "x\na 1",
                                   "2\na 1",
                                   "1\na",
                                   "1\na -1",
                                   "1\na 1.0",
                                   "1\na b 1",
                                   "2\na 1\na 0"}) {
    EXPECT_EQ(ReadError(FileWith(header + "\n" + one)), damaged_) << header;
  }
}

// Sizes whose bytes, or whose sum, overflow 64 bits.
TEST_F(CheckpointTest, LyingSizesDoNotAllocate) {
  const std::string one(8, '\0');
  for (const std::string size :
       {"2", "1000000000000", "2305843009213693952", "18446744073709551615"}) {
    EXPECT_EQ(ReadError(FileWith("1\na " + size + "\n" + one)), damaged_);
    EXPECT_EQ(ReadError(FileWith("2\na 1\nb " + size + "\n" + one)), damaged_);
  }
  EXPECT_EQ(ReadError(FileWith("18446744073709551615\na 1\n" + one)), damaged_);
}

// Far beyond the memory of a test: their values are not read.
TEST_F(CheckpointTest, HugeAndForeignFilesAreRefusedByTheirFirstBytes) {
  RunIdentity other;
  other.Add("method", "newton");
  std::string error;
  ASSERT_TRUE(StateArchive().Write(path_, other, &error)) << error;
  constexpr std::uintmax_t kSize = std::uintmax_t{1} << 40;
  std::filesystem::resize_file(path_, kSize);
  EXPECT_EQ(StateArchive::Read(path_, identity_).error(),
            path_ + ": it is of another run: method: newton, now none");
  EXPECT_EQ(StateArchive::Read(path_, other).error(), path_ + ": " + damaged_);
  std::filesystem::resize_file(path_, 0);
  std::filesystem::resize_file(path_, kSize);
  EXPECT_EQ(StateArchive::Read(path_, other).error(),
            path_ + ": not a checkpoint");
}

TEST_F(CheckpointTest, PipesAndFoldersAreNotRead) {
  ASSERT_EQ(::mkfifo(path_.c_str(), 0600), 0);
  EXPECT_EQ(StateArchive::Read(path_, identity_).error(),
            "cannot read " + path_ + ": not a regular file");
  EXPECT_EQ(StateArchive::Read("/dev/zero", identity_).error(),
            "cannot read /dev/zero: not a regular file");
}

TEST_F(CheckpointTest, CountsAreIntegersOfTheirType) {
  for (const double value : {-1.0,
                             0.5,
                             std::nan(""),
                             std::numeric_limits<double>::infinity(),
                             2147483648.0}) {
    StateArchive written;
    double number = value;
    written.Visit("count", &number);
    std::string error;
    ASSERT_TRUE(written.Write(path_, identity_, &error)) << error;
    StateArchive archive = StateArchive::Read(path_, identity_);
    int count = 7;
    archive.Visit("count", &count);
    EXPECT_EQ(archive.error(),
              path_ + ": array 'count' is missing or does not fit this run");
    EXPECT_EQ(count, 7);
  }
}

TEST_F(CheckpointTest, MissingFolderAndFileAreReported) {
  const std::string path = folder_ / "none/checkpoint";
  std::string error;
  EXPECT_FALSE(StateArchive().Write(path, identity_, &error));
  EXPECT_EQ(error, "cannot write " + path + ": No such file or directory");
  EXPECT_EQ(StateArchive::Read(path, identity_).error(),
            "cannot read " + path + ": No such file or directory");
}

TEST_F(CheckpointTest, WhatDoesNotFitChangesNothing) {
  SmallFile();
  StateArchive archive = StateArchive::Read(path_, identity_);
  VectorXd values = VectorXd::Constant(2, 7.0);
  archive.Visit("a", &values, 2);
  EXPECT_EQ(archive.error(),
            path_ + ": array 'a' is missing or does not fit this run");
  archive.Visit("b", &values);  // after an error
  EXPECT_EQ(values, VectorXd::Constant(2, 7.0));
}

}  // namespace checkpoint_test
}  // namespace invgrad
