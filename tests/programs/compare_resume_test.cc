// Runs of the program compare that are repeated and continued.

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/npy.h"
#include "invgrad/train.h"
#include "tests/programs/compare_program.h"

namespace invgrad {
namespace compare_resume_test {

namespace fs = std::filesystem;

TEST_F(CompareProgram, FlagFileRepeatsTheRunBitForBit) {
  ASSERT_EQ(Run(SmallRun("first")).exit_code, 0);
  const Output second = Run({"--flagfile=" + Path("first") + "/flags.txt",
                             "--output=" + Path("second")});
  ASSERT_EQ(second.exit_code, 0) << second.text;
  Eigen::VectorXd a, b;
  std::string error;
  const std::string weights = "/half_inverse-seed1/weights.npy";
  ASSERT_TRUE(ReadNpy(Path("first") + weights, 1444, &a, &error)) << error;
  ASSERT_TRUE(ReadNpy(Path("second") + weights, 1444, &b, &error)) << error;
  EXPECT_EQ(a, b);

  // So does a run that is given the first one's data and weights.
  std::vector<std::string> given = SmallRun("third");
  given[0] = "--problem=oscillator_chain:data_seed=9";
  given.push_back("--data=" + Path("first") + "/data.npy");
  given.push_back("--init_weights=" + Path("first") +
                  "/initial_weights-seed1.npy");
  given.push_back("--seeds=5");
  const Output third = Run(given);
  ASSERT_EQ(third.exit_code, 0) << third.text;
  ASSERT_TRUE(ReadNpy(
      Path("third") + "/half_inverse-seed5/weights.npy", 1444, &b, &error));
  EXPECT_EQ(a, b);
}

TEST_F(CompareProgram, AnotherNetworkIsInTheFlagFileAndIsNotResumedByAnother) {
  std::vector<std::string> arguments = SmallRun("first");
  arguments.insert(
      arguments.end(),
      {"--hidden=6-5", "--activation=relu", "--initialization=pytorch"});
  Output output = Run(arguments);
  ASSERT_EQ(output.exit_code, 0) << output.text;
  output = Run({"--flagfile=" + Path("first") + "/flags.txt",
                "--output=" + Path("second")});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  // 4-6-5-24.
  constexpr int kNumWeights = 4 * 6 + 6 + 6 * 5 + 5 + 5 * 24 + 24;
  Eigen::VectorXd a, b;
  std::string error;
  const std::string weights = "/half_inverse-seed1/weights.npy";
  ASSERT_TRUE(ReadNpy(Path("first") + weights, kNumWeights, &a, &error))
      << error;
  ASSERT_TRUE(ReadNpy(Path("second") + weights, kNumWeights, &b, &error))
      << error;
  EXPECT_EQ(a, b);

  std::vector<std::string> resume = SmallRun("first");
  resume.insert(resume.end(),
                {"--resume",
                 "--hidden=6-6",
                 "--activation=relu",
                 "--initialization=pytorch"});
  output = Run(resume);
  EXPECT_EQ(output.exit_code, 1);
  ExpectSays(output, {"had --hidden=6-5, now it is --hidden=6-6"});
}

TEST_F(CompareProgram, AFlagOfSeveralLinesIsRepeatedAndResumed) {
  const std::vector<std::string> arguments = {"--problem=squared_component",
                                              "--rules=adam,\nhalf_inverse",
                                              "--steps=2",
                                              "--plots=false",
                                              "--output=" + Path("first")};
  const Output first = Run(arguments);
  ASSERT_EQ(first.exit_code, 0) << first.text;
  std::vector<std::string> resume = arguments;
  resume.emplace_back("--resume");
  const Output resumed = Run(resume);
  EXPECT_EQ(resumed.exit_code, 0) << resumed.text;
  const Output second = Run({"--flagfile=" + Path("first") + "/flags.txt",
                             "--output=" + Path("second")});
  EXPECT_EQ(second.exit_code, 0) << second.text;
  EXPECT_TRUE(fs::exists(Path("second") + "/path-half_inverse.csv"));
}

// Whether it happens within ten seconds.
bool WaitUntil(const std::function<bool()>& has_happened) {
  for (int i = 0; i < 1000 && !has_happened(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return has_happened();
}

TEST_F(CompareProgram, InterruptKeepsTheResultsAndResumeGoesOn) {
  std::vector<std::string> arguments = SmallRun("run");
  arguments[1] = "--rules=half_inverse,adam:step_size=1e-2";
  arguments[2] = "--epochs=1000000";
  arguments.push_back("--checkpoint_seconds=0");
  pid_t child = Start(arguments);
  const std::string started = Path("run") + "/half_inverse-seed1";
  const std::string checkpoint = started + "/checkpoint";
  EXPECT_TRUE(WaitUntil([&] { return fs::exists(checkpoint); }));
  ::kill(child, SIGINT);
  const Output interrupted = Wait(child);
  EXPECT_EQ(interrupted.exit_code, 128 + SIGINT) << interrupted.text;
  ExpectSays(interrupted, {"ending after the current step; a second signal"});
  EXPECT_NE(interrupted.text.find("stopped"), std::string::npos)
      << interrupted.text;
  EXPECT_TRUE(fs::exists(started + "/weights.npy"));
  EXPECT_TRUE(fs::exists(Path("run") + "/table.txt"));
  EXPECT_FALSE(fs::exists(started + "/result.txt"));

  History before, after;
  std::string error;
  ASSERT_TRUE(ReadHistory(started + "/history.csv", &before, &error)) << error;
  const std::string state = ReadAll(checkpoint);
  arguments.push_back("--resume");
  child = Start(arguments);
  EXPECT_TRUE(WaitUntil([&] { return ReadAll(checkpoint) != state; }));
  ::kill(child, SIGINT);
  Wait(child);
  ASSERT_TRUE(ReadHistory(started + "/history.csv", &after, &error)) << error;
  EXPECT_GT(after.back().step, before.back().step);

  // Other flags would be another run.
  arguments[3] = "--batch_size=8";
  const Output other = Run(arguments);
  EXPECT_EQ(other.exit_code, 1);
  EXPECT_NE(other.text.find("batch_size"), std::string::npos) << other.text;
}

TEST_F(CompareProgram, AHangingGnuplotCostsNoTablesAndCtrlCEndsIt) {
  // It tells that it was started, and never ends.
  fs::create_directory(Path("bin"));
  const std::string started = Path("started");
  std::ofstream(Path("bin/gnuplot"))
      << "#!/bin/sh\ntouch '" << started << "'\nsleep 1000\n";
  fs::permissions(Path("bin/gnuplot"), fs::perms::owner_all);
  const std::string path = std::getenv("PATH");
  ::setenv("PATH", (Path("bin") + ":" + path).c_str(), 1);
  for (const std::string program : {"compare", "estimate", "sweep"}) {
    SCOPED_TRACE(program);
    const std::string output = "--output=" + Path(program);
    pid_t child = 0;
    if (program == "compare") {
      std::vector<std::string> arguments = SmallRun(program);
      arguments[4] = "--plots";
      child = Start(arguments);
    } else if (program == "sweep") {
      child = StartProgram(program,
                           {"--problem=toy_network:num_samples=32",
                            "--grid=rule=adam;lambda=1,0.1",
                            "--steps=2",
                            output});
    } else {
      std::ofstream(Path("square.g2o"))
          << "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1.1 0 1.5\n"
             "EDGE_SE2 0 1 1 0 1.5708 10 0 0 10 0 100\n";
      child = StartProgram(program, {"--input=" + Path("square.g2o"), output});
    }
    WaitForFile(started);
    EXPECT_TRUE(fs::remove(started));
    EXPECT_TRUE(fs::exists(Path(program) + "/table.txt"));
    ::kill(child, SIGTERM);
    const Output ended = Wait(child);
    EXPECT_EQ(ended.exit_code, 128 + SIGTERM) << ended.text;
    ExpectSays(ended,
               {"results in", "gnuplot was ended by a signal", "no picture"});
  }
  ::setenv("PATH", path.c_str(), 1);
}

TEST_F(CompareProgram, ALargerBudgetGoesOnWithARunThatIsDone) {
  std::vector<std::string> arguments = SmallRun("whole");
  arguments[2] = "--epochs=5";
  ASSERT_EQ(Run(arguments).exit_code, 0);
  ASSERT_EQ(Run(SmallRun("run")).exit_code, 0);
  arguments.back() = "--output=" + Path("run");
  arguments.push_back("--resume");
  const Output resumed = Run(arguments);
  ASSERT_EQ(resumed.exit_code, 0) << resumed.text;
  for (const std::string name : {"half_inverse", "adam-step_size-1e-2"}) {
    const std::string weights = "/" + name + "-seed1/weights.npy";
    EXPECT_EQ(ReadAll(Path("run") + weights), ReadAll(Path("whole") + weights));
    History history;
    std::string error;
    ASSERT_TRUE(ReadHistory(
        Path("run/" + name + "-seed1/history.csv"), &history, &error));
    EXPECT_EQ(history.size(), 6u);
    // That of the shorter run is not the path of this one.
    EXPECT_FALSE(fs::exists(Path("run/" + name + "-seed1/sample_path.csv")));
  }
  // Done is done: nothing runs, and the table is the same.
  const Output again = Run(arguments);
  EXPECT_EQ(again.exit_code, 0);
  EXPECT_EQ(again.text, resumed.text);
}

// With a checkpoint after every step, at any time.
TEST_F(CompareProgram, AKilledRunGoesOnBitForBit) {
  std::vector<std::string> arguments = SmallRun("whole");
  arguments[2] = "--epochs=30";
  arguments.insert(arguments.end(), {"--shuffle", "--checkpoint_seconds=0"});
  ASSERT_EQ(Run(arguments).exit_code, 0);
  arguments[5] = "--output=" + Path("run");
  const std::string checkpoint = Path("run") + "/half_inverse-seed1/checkpoint";
  for (int kills = 0; kills < 3; ++kills) {
    const std::string state = ReadAll(checkpoint);
    const pid_t child = Start(arguments);
    EXPECT_TRUE(WaitUntil([&] { return ReadAll(checkpoint) != state; }));
    ::kill(child, SIGKILL);
    Wait(child);
    if (kills == 0) arguments.push_back("--resume");
  }
  const Output resumed = Run(arguments);
  ASSERT_EQ(resumed.exit_code, 0) << resumed.text;
  for (const std::string name : {"half_inverse", "adam-step_size-1e-2"}) {
    const std::string weights = "/" + name + "-seed1/weights.npy";
    EXPECT_EQ(ReadAll(Path("run") + weights), ReadAll(Path("whole") + weights));
  }
  for (const auto& entry : fs::recursive_directory_iterator(Path("run"))) {
    EXPECT_EQ(entry.path().string().find(".tmp"), std::string::npos) << entry;
  }
}

TEST_F(CompareProgram, PhasesAreOneRunThatGoesOn) {
  const std::string rules =
      "--rules=adam:step_size=1e-2:batch_size=32:epochs=2>half_inverse";
  const std::string label =
      "adam-step_size-1e-2-batch_size-32-epochs-2-half_inverse";
  const auto arguments = [&](const std::string& output) {
    std::vector<std::string> words = SmallRun(output);
    words.push_back(rules);
    return words;
  };
  ASSERT_EQ(Run(arguments("whole")).exit_code, 0);
  // Stopped within the first phase, and at its end.
  for (const char* epochs : {"--epochs=1", "--epochs=2", "--epochs=3"}) {
    std::vector<std::string> words = arguments("run");
    words.insert(words.end(), {epochs, "--resume"});
    const Output output = Run(words);
    ASSERT_EQ(output.exit_code, 0) << output.text;
    ExpectSays(output, {"epochs done"});
  }
  const std::string directory = "/" + label + "-seed1";
  EXPECT_TRUE(fs::exists(Path("run") + directory + "/checkpoint"));
  const std::string weights = directory + "/weights.npy";
  EXPECT_EQ(ReadAll(Path("run") + weights), ReadAll(Path("whole") + weights));
  // 2 steps an epoch, then 4 of the command line's batch size.
  History history;
  std::string error;
  ASSERT_TRUE(
      ReadHistory(Path("run") + directory + "/history.csv", &history, &error))
      << error;
  std::vector<long> steps;
  for (const HistoryRow& row : history) steps.push_back(row.step);
  EXPECT_EQ(steps, (std::vector<long>{0, 2, 4, 8}));
  EXPECT_EQ(history.back().epoch, 3.0);

  ExpectRefused({"--rules=adam>half_inverse"}, {"--rules: 'adam' needs"});
  ExpectRefused({"--rules=adam:batch_size=9999:epochs=1>half_inverse"},
                {"batch_size=9999", "4096"});
  // A point has no network to train: a row that says so.
  const Output point = Run({"--problem=squared_component",
                            "--rules=newton,adam:steps=1>newton",
                            "--plots=false",
                            "--output=" + Path("point")});
  ExpectSays(point, {"a method in phases needs a network to train"});
}

}  // namespace compare_resume_test
}  // namespace invgrad
