#include "invgrad/io/atomic_file.h"

#include <sys/resource.h>
#include <sys/stat.h>

#include <csignal>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace atomic_file_test {

TEST(AtomicFile, RoundTripReplacesAndLeavesNothingElse) {
  const TemporaryFolder folder;
  const std::string path = folder / "file";
  std::string error;
  const std::string bytes("binary \0 and \xff\n", 14);
  for (const std::string& content : {bytes, std::string(), std::string("b")}) {
    ASSERT_TRUE(WriteFile(path, content, &error)) << error;
    std::string back = "something";
    ASSERT_TRUE(ReadFile(path, &back, &error)) << error;
    EXPECT_EQ(back, content);
    EXPECT_EQ(folder.NumFiles(), 1);
  }
}

TEST(AtomicFile, WritesPartAfterPart) {
  const TemporaryFolder folder;
  const std::vector<std::string_view> parts = {"a", {}, "bc"};
  std::string error, back;
  ASSERT_TRUE(WriteFile(folder / "file", parts, &error)) << error;
  ASSERT_TRUE(ReadFile(folder / "file", &back, &error)) << error;
  EXPECT_EQ(back, "abc");
}

TEST(AtomicFile, PermissionsFollowTheUmask) {
  const TemporaryFolder folder;
  std::string error;
  const mode_t before = umask(027);
  EXPECT_TRUE(WriteFile(folder / "file", "x", &error)) << error;
  umask(before);
  struct stat status;
  ASSERT_EQ(stat((folder / "file").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0640);
}

TEST(AtomicFile, MissingFolderIsNamedWithTheReason) {
  const TemporaryFolder folder;
  const std::string path = folder / "none/file";
  std::string error;
  EXPECT_FALSE(WriteFile(path, "x", &error));
  EXPECT_EQ(error, "cannot write " + path + ": No such file or directory");
  std::string bytes = "kept";
  EXPECT_FALSE(ReadFile(path, &bytes, &error));
  EXPECT_EQ(error, "cannot read " + path + ": No such file or directory");
  EXPECT_EQ(bytes, "kept");
}

TEST(AtomicFile, FailedRenameRemovesTheTemporary) {
  const TemporaryFolder folder;
  const std::string path = folder / "taken";
  std::filesystem::create_directory(path);
  std::string error;
  EXPECT_FALSE(WriteFile(path, "x", &error));
  EXPECT_EQ(error, "cannot write " + path + ": Is a directory");
  EXPECT_EQ(folder.NumFiles(), 1);
}

TEST(AtomicFile, FailedWriteKeepsTheOldFile) {
  const TemporaryFolder folder;
  const std::string path = folder / "file";
  std::string error;
  ASSERT_TRUE(WriteFile(path, "old", &error)) << error;

  // A limit on the size of files stands in for a disk that is full.
  rlimit before;
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  rlimit limit = before;
  limit.rlim_cur = 1000;
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
  const bool is_written = WriteFile(path, std::string(5000, 'x'), &error);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);

  EXPECT_FALSE(is_written);
  EXPECT_EQ(error, "cannot write " + path + ": File too large");
  std::string bytes;
  EXPECT_TRUE(ReadFile(path, &bytes, &error));
  EXPECT_EQ(bytes, "old");
  EXPECT_EQ(folder.NumFiles(), 1);
}

TEST(AtomicFile, ReadsRegularFilesOnly) {
  const TemporaryFolder folder;
  std::string bytes;
  std::string error;
  EXPECT_FALSE(ReadFile(folder / ".", &bytes, &error));
  EXPECT_EQ(error, "cannot read " + (folder / ".") + ": not a regular file");
  EXPECT_FALSE(ReadFile("/dev/zero", &bytes, &error));  // would have no end
  EXPECT_EQ(error, "cannot read /dev/zero: not a regular file");
  // A pipe without a writer would never give anything.
  const std::string pipe = folder / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_FALSE(ReadFile(pipe, &bytes, &error));
  EXPECT_EQ(error, "cannot read " + pipe + ": not a regular file");
  std::filesystem::create_symlink("loop", folder / "loop");
  EXPECT_FALSE(ReadFile(folder / "loop", &bytes, &error));
  EXPECT_EQ(error,
            "cannot read " + (folder / "loop") +
                ": Too many levels of symbolic links");
}

TEST(AtomicFile, ReadsNoMoreThanIsAllowed) {
  const TemporaryFolder folder;
  const std::string path = folder / "file";
  std::string bytes = "before";
  std::string error;
  ASSERT_TRUE(WriteFile(path, "12345", &error)) << error;
  EXPECT_FALSE(ReadFile(path, &bytes, &error, 4));
  EXPECT_EQ(error,
            "cannot read " + path + ": it has 5 bytes; at most 4 are allowed");
  EXPECT_EQ(bytes, "before");
  EXPECT_TRUE(ReadFile(path, &bytes, &error, 5));
  EXPECT_EQ(bytes, "12345");
  std::uint64_t size = 0;
  EXPECT_TRUE(ReadBeginning(path, 2, &bytes, &size, &error));
  EXPECT_EQ(bytes, "12");
  EXPECT_EQ(size, 5u);
}

TEST(AtomicFile, RefusesMoreThanTheMemory) {
  const TemporaryFolder folder;
  const std::string path = folder / "large";
  std::ofstream(path) << "x";
  std::filesystem::resize_file(path, std::uintmax_t{1} << 43);  // sparse
  std::string bytes;
  std::string error;
  EXPECT_FALSE(ReadFile(path, &bytes, &error));
  EXPECT_NE(error.find("cannot read " + path +
                       ": it needs 8.8 TB for its bytes; the limit is "),
            std::string::npos)
      << error;
}

// Of some files the system does not say the size.
TEST(AtomicFile, ReadsFilesOfTheSystem) {
  std::string bytes;
  std::string error;
  EXPECT_TRUE(ReadFile("/proc/self/status", &bytes, &error)) << error;
  EXPECT_NE(bytes.find("VmSize"), std::string::npos);
}

TEST(AtomicFile, TheNameOfATemporaryFileSaysItsTarget) {
  EXPECT_EQ(TargetOfTemporary("a/weights.npy.tmp12-3"), "a/weights.npy");
  EXPECT_EQ(TargetOfTemporary("a.tmp1-0.tmp12-34"), "a.tmp1-0");
  for (const char* name : {"",
                           "12-3",
                           ".tmp12-3",
                           "a.tmp",
                           "a.tmp12",
                           "a.tmp12-",
                           "a.tmp-3",
                           "a.tmp12-3x",
                           "a.temp12-3",
                           "a.tmp12-3/b",
                           "atmp12-3"}) {
    EXPECT_EQ(TargetOfTemporary(name), "") << name;
  }
}

}  // namespace atomic_file_test
}  // namespace invgrad
