#include "report/progress.h"

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <iterator>
#include <limits>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/io/format.h"

namespace invgrad {
namespace progress_test {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(FormatDuration, ChoosesItsUnits) {
  EXPECT_EQ(FormatDuration(0.0), "0.000 s");
  EXPECT_EQ(FormatDuration(0.25), "0.250 s");
  EXPECT_EQ(FormatDuration(12.34), "12.3 s");
  EXPECT_EQ(FormatDuration(185.0), "3 min 05 s");
  EXPECT_EQ(FormatDuration(7380.0), "2 h 03 min");
  EXPECT_EQ(FormatDuration(371000.0), "4 d 07 h");
}

TEST(FormatDuration, RoundsUpToTheNextUnit) {
  EXPECT_EQ(FormatDuration(0.9994), "0.999 s");
  EXPECT_EQ(FormatDuration(0.9996), "1.0 s");
  EXPECT_EQ(FormatDuration(59.94), "59.9 s");
  EXPECT_EQ(FormatDuration(59.96), "1 min 00 s");
  EXPECT_EQ(FormatDuration(3599.4), "59 min 59 s");
  EXPECT_EQ(FormatDuration(3599.6), "1 h 00 min");
  EXPECT_EQ(FormatDuration(86369.0), "23 h 59 min");
  EXPECT_EQ(FormatDuration(86371.0), "1 d 00 h");
}

TEST(FormatDuration, WhatIsNotADuration) {
  EXPECT_EQ(FormatDuration(-1.0), "?");
  EXPECT_EQ(FormatDuration(kInfinity), "?");
  EXPECT_EQ(FormatDuration(std::nan("")), "?");
  EXPECT_EQ(FormatDuration(1e300), "?");
}

TEST(FormatNumber, IsShort) {
  EXPECT_EQ(FormatNumber(0.0), "0");
  EXPECT_EQ(FormatNumber(0.25), "0.25");
  EXPECT_EQ(FormatNumber(1234.4), "1234");
  EXPECT_EQ(FormatNumber(123456.0), "1.235e+05");
  EXPECT_EQ(FormatNumber(3.14159e-7), "3.142e-07");
  EXPECT_EQ(FormatNumber(-3.14159e-7, 2), "-3.1e-07");
  EXPECT_EQ(FormatNumber(kInfinity), "inf");
  EXPECT_EQ(FormatNumber(-kInfinity), "-inf");
  EXPECT_EQ(FormatNumber(-std::nan("")), "nan");
}

class ProgressTest : public testing::Test {
 protected:
  ~ProgressTest() override { std::fclose(out_); }

  Progress::Options Options(bool is_terminal) {
    Progress::Options options;
    options.out = out_;
    options.is_terminal = is_terminal;
    options.clock = [this]() { return now_; };
    return options;
  }

  // What was written since the last call.
  std::string Written() {
    std::string text;
    std::fseek(out_, position_, SEEK_SET);
    for (int c = 0; (c = std::fgetc(out_)) != EOF;) {
      text += static_cast<char>(c);
    }
    position_ = std::ftell(out_);
    return text;
  }

  static ProgressState State(long step, double fraction) {
    ProgressState state;
    state.label = "adam";
    state.step = step;
    state.fraction = fraction;
    return state;
  }

  std::FILE* out_ = std::tmpfile();
  long position_ = 0;
  double now_ = 1000.0;
};

TEST_F(ProgressTest, TellsAllThatIsKnown) {
  Progress progress(Options(/*is_terminal=*/false));
  ProgressState state = State(0, 0.0);
  progress.Update(state);
  EXPECT_EQ(Written(), "");
  now_ += 10.0;
  state.step = 1200;
  state.epoch = 4.25;
  state.loss = 3.14159e-7;
  state.fraction = 0.2;
  progress.Update(state);
  EXPECT_EQ(Written(),
            "adam  step 1200  epoch 4.2  loss 3.142e-07  120 steps/s  "
            "elapsed 10.0 s  left 40.0 s\n");
}

TEST_F(ProgressTest, WhatHasNoStepsShowsNone) {
  Progress progress(Options(/*is_terminal=*/false));
  progress.Update(State(ProgressState::kNoStep, 0.0));
  now_ += 10.0;
  progress.Update(State(ProgressState::kNoStep, 0.5));
  EXPECT_EQ(Written(), "adam  elapsed 10.0 s  left 10.0 s\n");
}

TEST_F(ProgressTest, LinesAreSeldomAwayFromATerminal) {
  Progress progress(Options(/*is_terminal=*/false));
  int num_lines = 0;
  for (int step = 0; step <= 100; ++step) {
    progress.Update(State(step, 0.01 * step));
    num_lines += Written().empty() ? 0 : 1;
    now_ += 0.5;
  }
  EXPECT_EQ(num_lines, 5);  // 50 seconds
}

TEST_F(ProgressTest, AResumedRunCountsFromWhereItBegan) {
  Progress progress(Options(/*is_terminal=*/false));
  progress.Update(State(5000, 0.5));
  now_ += 20.0;
  progress.Update(State(5100, 0.75));
  EXPECT_EQ(Written(),
            "adam  step 5100  5 steps/s  elapsed 20.0 s  left 20.0 s\n");
}

TEST_F(ProgressTest, AStepThatTakesLongIsShownWhileItLasts) {
  for (const bool is_terminal : {false, true}) {
    SCOPED_TRACE(is_terminal);
    Progress progress(Options(is_terminal));
    progress.Update(State(3, 0.25));
    Written();
    int num_lines = 0;
    std::string last;
    for (int second = 1; second <= 30; ++second) {
      now_ += 1.0;
      progress.Tick();
      const std::string line = Written();
      if (line.empty()) continue;
      EXPECT_GE(second, 5);
      ++num_lines;
      last = line;
    }
    EXPECT_EQ(num_lines, is_terminal ? 26 : 3);
    EXPECT_EQ(last,
              std::string(is_terminal ? "\r" : "") +
                  "adam  step 3  elapsed 30.0 s  this step 30.0 s" +
                  (is_terminal ? "" : "\n"));
    progress.Update(State(4, 0.5));
    Written();
    now_ += 4.0;  // the next step
    progress.Tick();
    EXPECT_EQ(Written(), "");
    progress.Clear();
    now_ += 20.0;
    Written();
    progress.Tick();  // nothing runs
    EXPECT_EQ(Written(), "");
  }
}

// Of this process.
std::ptrdiff_t NumThreads() {
  const std::filesystem::directory_iterator tasks("/proc/self/task");
  return std::distance(begin(tasks), end(tasks));
}

TEST_F(ProgressTest, AThreadTicksByTheSteadyClockAndByNoOther) {
  for (const bool is_steady : {false, true}) {
    SCOPED_TRACE(is_steady);
    Progress::Options options = Options(/*is_terminal=*/false);
    if (is_steady) options.clock = nullptr;
    const std::ptrdiff_t before = NumThreads();
    Progress progress(options);
    progress.Update(State(0, 0.0));
    EXPECT_EQ(NumThreads(), before + (is_steady ? 1 : 0));
  }
}

TEST_F(ProgressTest, BeforeTheFirstStepThereIsNoSpeed) {
  Progress progress(Options(/*is_terminal=*/false));
  progress.Update(State(ProgressState::kNoStep, ProgressState::kUnknown));
  now_ += 12.0;
  progress.Tick();
  EXPECT_EQ(Written(), "adam  elapsed 12.0 s  this step 12.0 s\n");
  progress.Update(State(5000, 0.5));  // a resumed run
  now_ += 20.0;
  progress.Update(State(5100, 0.75));
  EXPECT_EQ(Written(),
            "adam  step 5100  5 steps/s  elapsed 20.0 s  left 20.0 s\n");
}

TEST_F(ProgressTest, UnknownFractionHasNoTimeLeft) {
  Progress progress(Options(/*is_terminal=*/false));
  progress.Update(State(0, ProgressState::kUnknown));
  now_ += 10.0;
  progress.Update(State(5, ProgressState::kUnknown));
  EXPECT_EQ(Written(), "adam  step 5  0.5 steps/s  elapsed 10.0 s\n");
}

TEST_F(ProgressTest, OnATerminalTheLineIsRewritten) {
  {
    Progress progress(Options(/*is_terminal=*/true));
    ProgressState state = State(9, 0.0);
    state.loss = 0.123;
    progress.Update(state);
    const std::string first = "adam  step 9  loss 0.123  elapsed 0.000 s";
    EXPECT_EQ(Written(), "\r" + first);

    now_ += 0.05;  // too early
    progress.Update(state);
    EXPECT_EQ(Written(), "");

    now_ += 0.075;
    const std::string second = "adam  step 9  elapsed 0.125 s";
    progress.Update(State(9, 0.0));
    EXPECT_EQ(Written(),
              "\r" + second + std::string(first.size() - second.size(), ' '));

    progress.Clear();
    EXPECT_EQ(Written(), "\r" + std::string(second.size(), ' ') + "\r");
  }
  EXPECT_EQ(Written(), "");  // nothing left to clear
}

TEST_F(ProgressTest, TheLineFitsTheTerminal) {
  Progress progress(Options(/*is_terminal=*/true));
  ProgressState state = State(1, 0.0);
  state.label = std::string(200, 'x');
  progress.Update(state);
  EXPECT_EQ(Written(), "\r" + std::string(79, 'x'));
}

}  // namespace progress_test
}  // namespace invgrad
