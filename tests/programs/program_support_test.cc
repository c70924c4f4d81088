// What the programs share: lists on the command line, messages, exit codes and
// names of files.

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <new>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

#include "bin/support/program.h"
#include "bin/support/run_output.h"
#include "bin/support/versions.h"
#include "gtest/gtest.h"

namespace invgrad {
namespace program_support_test {

TEST(ParseSeeds, TakesEveryIntegerOfItsRange) {
  std::vector<int> seeds;
  std::string error;
  ASSERT_TRUE(ParseSeeds("3,0,2147483647", &seeds, &error)) << error;
  EXPECT_EQ(seeds, (std::vector<int>{3, 0, std::numeric_limits<int>::max()}));
}

TEST(ParseSeeds, ExpandsRanges) {
  const auto parse = [](const std::string& text) {
    std::vector<int> seeds;
    std::string error;
    EXPECT_TRUE(ParseSeeds(text, &seeds, &error)) << error;
    return seeds;
  };
  EXPECT_EQ(parse("3..6"), (std::vector<int>{3, 4, 5, 6}));
  EXPECT_EQ(parse("1,...,4"), (std::vector<int>{1, 2, 3, 4}));
  EXPECT_EQ(parse("9,1,3,...,7"), (std::vector<int>{9, 1, 3, 5, 7}));
  EXPECT_EQ(parse("2147483645..2147483647,0"),
            (std::vector<int>{2147483645, 2147483646, 2147483647, 0}));
  EXPECT_EQ(parse("1,2,...,20").size(), 20u);
}

TEST(ParseSeeds, SaysWhatItRefuses) {
  std::vector<int> seeds;
  std::string error;
  for (const char* text :
       {"-1",     "2147483648", "1.5",     "x",    "1,x",       "1,1",
        "1,,2",   "",           ",",       "...",  "1,...",     "...,3",
        "3..1",   "1..",        "..3",     "1..x", "1,3,...,6", "3,2,...,9",
        "2,1..3", "1...3",      "0..10000"}) {
    SCOPED_TRACE(text);
    error.clear();
    EXPECT_FALSE(ParseSeeds(text, &seeds, &error));
    EXPECT_FALSE(error.empty());
  }
}

TEST(ParseNumbers, TakesPositiveNumbersAndNone) {
  std::vector<double> numbers;
  std::string error;
  ASSERT_TRUE(ParseNumbers("1e-3,2,0.5", &numbers, &error)) << error;
  EXPECT_EQ(numbers, (std::vector<double>{1e-3, 2.0, 0.5}));
  ASSERT_TRUE(ParseNumbers("", &numbers, &error)) << error;
  EXPECT_TRUE(numbers.empty());
  for (const char* text : {"0", "-1", "inf", "nan", "1e-3x", "1,,2"}) {
    SCOPED_TRACE(text);
    EXPECT_FALSE(ParseNumbers(text, &numbers, &error));
  }
}

TEST(Warn, WritesAMessageInOnePiece) {
  // A read of this pipe ends where a write did.
  std::array<int, 2> pipe = {};
  ASSERT_EQ(pipe2(pipe.data(), O_DIRECT | O_NONBLOCK), 0);
  const int standard_error = dup(STDERR_FILENO);
  dup2(pipe[1], STDERR_FILENO);
  Warn("two\nlines");
  dup2(standard_error, STDERR_FILENO);
  std::array<char, 1000> text = {};
  const ssize_t size = read(pipe[0], text.data(), text.size());
  const std::string line(text.data(), size < 0 ? 0 : size);
  EXPECT_NE(line.find(": two\nlines\n"), std::string::npos) << line;
  EXPECT_LT(read(pipe[0], text.data(), text.size()), 0);
  for (const int file : {pipe[0], pipe[1], standard_error}) close(file);
}

// Runs a program without arguments, and ends with its exit code.
void ExitAs(bool (*run)(RunCounts* counts, std::string* error)) {
  setenv("OPENBLAS_CORETYPE", "set", 1);  // so that it does not start again
  std::string name = "program";
  char* arguments[] = {name.data(), nullptr};
  char** argv = arguments;
  std::exit(RunProgram(1, argv, "does nothing", run));
}

TEST(RunProgramDeathTest, ExceptionsAreMessages) {
  EXPECT_EXIT(
      ExitAs([](RunCounts*, std::string*) -> bool { throw std::bad_alloc(); }),
      testing::ExitedWithCode(1),
      "program: there is not enough memory");
  EXPECT_EXIT(ExitAs([](RunCounts*, std::string*) -> bool {
                throw std::filesystem::filesystem_error("the path",
                                                        std::error_code());
              }),
              testing::ExitedWithCode(1),
              "program: .*the path");
}

TEST(RunProgramDeathTest, TheCountsAreTheExitCode) {
  EXPECT_EXIT(ExitAs([](RunCounts*, std::string*) { return true; }),
              testing::ExitedWithCode(0),
              "");
  EXPECT_EXIT(ExitAs([](RunCounts* counts, std::string*) {
                *counts = {2, 1};
                return true;
              }),
              testing::ExitedWithCode(2),
              "");
  EXPECT_EXIT(ExitAs([](RunCounts* counts, std::string*) {
                *counts = {0, 3};
                return true;
              }),
              testing::ExitedWithCode(3),
              "program: no run worked");
}

TEST(Versions, AProcessorMayHaveNoName) {
  const auto name = [](const std::string& text) {
    std::istringstream cpuinfo(text);
    return CpuName(cpuinfo);
  };
  EXPECT_EQ(name("processor\t: 0\nmodel name\t: A: B 2\nmodel name\t: C\n"),
            "A: B 2");
  EXPECT_EQ(name("model name\t:\n"), "unknown");
  EXPECT_EQ(name("processor\t: 0\n"), "unknown");
}

TEST(RunOutput, FileNamesHaveNoSpecialCharacters) {
  EXPECT_EQ(FileName("half_inverse:truncation=1e-6"),
            "half_inverse-truncation-1e-6");
  EXPECT_EQ(FileName("ceres_lm+adam"), "ceres_lm+adam");
  EXPECT_EQ(FileName("../a b/c"), "..-a-b-c");
}

TEST(RunOutput, LongFileNamesAreCutAndStayDifferent) {
  const std::string label(180, 'x');
  EXPECT_EQ(FileName(label), label);
  const std::string one = FileName(label + "1");
  const std::string two = FileName(label + "2");
  EXPECT_EQ(one.size(), 180u);
  EXPECT_EQ(one.substr(0, 163), label.substr(0, 163));
  EXPECT_NE(one, two);
}

}  // namespace program_support_test
}  // namespace invgrad
