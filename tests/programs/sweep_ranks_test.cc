// Sweeps on several ranks of MPI: the same results, one message of all ranks,
// and nothing lost when ranks are killed.

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "bin/support/ranks.h"
#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "tests/programs/sweep_program.h"
#include "tests/support/mpirun.h"

namespace invgrad {
namespace sweep_ranks_test {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

int NumTimes(const std::string& word, const std::string& text) {
  int count = 0;
  for (size_t at = text.find(word); at != std::string::npos;
       at = text.find(word, at + 1)) {
    ++count;
  }
  return count;
}

class SweepRanks : public SweepProgram {
 protected:
  void SetUp() override {
    if (!PrepareMpirun()) GTEST_SKIP() << kNoMpi;
  }

  static std::string Program() { return BinDir() + "/sweep"; }

  // "mpirun -n N sweep ARGUMENTS".
  pid_t StartRanks(int num_ranks, const Words& arguments) const {
    return StartCommand(MpirunCommand(num_ranks, Program(), arguments));
  }

  Output RunRanks(int num_ranks, const Words& arguments) const {
    return Wait(StartRanks(num_ranks, arguments));
  }

  // Two ranks, each with a command of its own, in a directory of its own. By a
  // shell, because mpirun of Debian 13 (Open MPI 5.0.7) fails with the words
  // "a : b".
  Output RunUnlikeRanks(const Words& first,
                        const Words& second,
                        const std::string& first_directory = ".",
                        const std::string& second_directory = ".") const {
    const auto line = [](const std::string& directory, const Words& words) {
      std::string text = "cd '" + directory + "' && exec";
      for (const std::string& word : words) text += " '" + word + "'";
      return text;
    };
    return Wait(StartCommand({"mpirun",
                              "-n",
                              "2",
                              "sh",
                              "-c",
                              "if [ \"$OMPI_COMM_WORLD_RANK\" = 0 ]; then " +
                                  line(first_directory, first) + "; else " +
                                  line(second_directory, second) + "; fi"}));
  }

  // Exit code 1, and one message of all ranks.
  static void ExpectOneMessage(const Output& output, const Words& words) {
    EXPECT_EQ(output.exit_code, 1) << output.text;
    ExpectSays(output, words);
    EXPECT_EQ(NumTimes("sweep: ", output.text), 1) << output.text;
  }

  // Two runs without an end, and one that diverges at once.
  Words EndlessSweep(const std::string& output) const {
    Words arguments = SmallSweep(output);
    arguments[1] =
        "--grid=rule=gradient_descent:step_size=1e200,adam,rmsprop;seed=1";
    arguments[2] = "--steps=1000000000";
    return arguments;
  }

  void WaitForJobs(const std::string& output, size_t num_jobs) const {
    for (int i = 0; i < 6000; ++i) {
      if (fs::exists(Path(output) + "/jobs") &&
          Jobs(output).size() == num_jobs) {
        return;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    ADD_FAILURE() << "the jobs do not start";
  }

  // Processes of sweep with a path in this test's folder.
  int NumProcesses() const {
    int count = 0;
    for (const auto& process : fs::directory_iterator("/proc")) {
      std::error_code failure;
      const std::string path = process.path();
      if (fs::read_symlink(path + "/exe", failure) != Program()) continue;
      const std::string words = ReadAll(path + "/cmdline");
      count += words.find(Path("")) != std::string::npos ? 1 : 0;
    }
    return count;
  }
};

TEST_F(SweepRanks, AnyNumberGivesTheSameResults) {
  ASSERT_EQ(Run(SmallSweep("alone")).exit_code, kSomeFailed);
  for (const int num_ranks : {1, 2, 3}) {
    const std::string name = std::to_string(num_ranks);
    const Output output = RunRanks(num_ranks, SmallSweep(name));
    EXPECT_EQ(output.exit_code, kSomeFailed) << output.text;
    EXPECT_EQ(NumTimes("results in ", output.text), 1) << output.text;
    EXPECT_EQ(Losses(name), Losses("alone"));
    EXPECT_EQ(ReadAll(Path(name) + "/files.txt").size(),
              ReadAll(Path("alone") + "/files.txt").size());
  }
  Words threaded = SmallSweep("threaded");
  threaded.emplace_back("--threads=2");
  EXPECT_EQ(RunRanks(2, threaded).exit_code, kSomeFailed);
  EXPECT_EQ(Losses("threaded"), Losses("alone"));
  const Output again = RunRanks(2, SmallSweep("alone"));
  ExpectSays(again, {"8 of 8 runs were done before"});
}

TEST_F(SweepRanks, ASignalToMpirunKeepsWhatIsComplete) {
  const pid_t mpirun = StartRanks(2, EndlessSweep("run"));
  WaitForJobs("run", 3);
  ::kill(mpirun, SIGUSR1);  // mpirun passes it on, and waits
  const Output output = Wait(mpirun);
  EXPECT_EQ(output.exit_code, 128 + SIGTERM) << output.text;
  EXPECT_EQ(NumTimes("ending after the current step", output.text), 1)
      << output.text;
  EXPECT_EQ(NumTimes("sweep: the same command goes on", output.text), 1)
      << output.text;
  EXPECT_EQ(Results("run")[0].at("status").substr(0, 8), "diverged");
  EXPECT_EQ(Results("run")[1].at("status"), "interrupted");
}

TEST_F(SweepRanks, OneRankSaysWhatIsWrong) {
  Words arguments = SmallSweep("run");
  arguments[1] = "--grid=rule=adm";
  ExpectOneMessage(RunRanks(3, arguments), {"'adm'"});
  const Output unknown = RunRanks(2, {"--no_flag"});
  EXPECT_EQ(unknown.exit_code, 1);
  EXPECT_EQ(NumTimes("unknown command line flag", unknown.text), 1)
      << unknown.text;
  EXPECT_FALSE(fs::exists(Path("run")));
}

TEST_F(SweepRanks, RanksThatDifferAreRefused) {
  Words sweep = SmallSweep("run");
  sweep.insert(sweep.begin(), Program());
  Words more = sweep;
  more.push_back("--tail=0.5");
  ExpectOneMessage(RunUnlikeRanks(sweep, more),
                   {"rank 1 on ", " has the arguments ", "--tail=0.5"});
  Words other = sweep;
  other[0] = Path("other");
  fs::copy_file(Program(), other[0]);
  std::ofstream(other[0], std::ios::app) << "x";
  ExpectOneMessage(RunUnlikeRanks(sweep, other),
                   {"rank 1 on ", " has a program with the digest "});
  Words kernels = sweep;
  kernels.insert(kernels.begin(), {"env", "OPENBLAS_CORETYPE=Nehalem"});
  const Output output = RunUnlikeRanks(sweep, kernels);
  EXPECT_EQ(output.exit_code, 1) << output.text;
  ExpectSays(output, {"rank 1 on ", " has the BLAS kernels", "Nehalem"});
  EXPECT_FALSE(fs::exists(Path("run")));
}

TEST_F(SweepRanks, ADirectoryThatNotAllSeeIsRefused) {
  fs::create_directories(Path("a"));
  fs::create_directories(Path("b"));
  Words sweep = SmallSweep("run");
  sweep.insert(sweep.begin(), Program());
  sweep.back() = "--output=run";
  ExpectOneMessage(RunUnlikeRanks(sweep, sweep, Path("a"), Path("b")),
                   {"--output=run: rank 1 on ", "does not see"});
  EXPECT_TRUE(fs::is_empty(Path("a")));
  EXPECT_TRUE(fs::is_empty(Path("b")));
}

TEST_F(SweepRanks, RanksThatAreAloneAreRefused) {
  ::setenv("SLURM_STEP_NUM_TASKS", "2", 1);
  ::setenv("SLURM_PROCID", "0", 1);
  const Output first = Run(SmallSweep("run"));
  ::setenv("SLURM_PROCID", "1", 1);
  const Output second = Run(SmallSweep("run"));
  ::unsetenv("SLURM_STEP_NUM_TASKS");
  ::unsetenv("SLURM_PROCID");
  ExpectOneMessage(first,
                   {"the launcher has started 2 ranks, and each finds itself "
                    "alone"});
  EXPECT_EQ(second.exit_code, 1);
  EXPECT_EQ(second.text, "");
  EXPECT_FALSE(fs::exists(Path("run")));
}

// Kills a rank at a random moment, then completes the sweep. --gtest_repeat with
// --gtest_shuffle does it more often, at other moments.
TEST_F(SweepRanks, KilledRanksLoseOnlyWhatTheyWereRunning) {
  Words arguments = SmallSweep("whole");
  arguments[1] += ",2";  // a second seed
  arguments[2] = "--steps=5000";
  arguments.insert(arguments.begin(), "--checkpoint_seconds=0.05");
  ASSERT_EQ(Run(arguments).exit_code, kSomeFailed);
  arguments.back() = "--output=" + Path("run");
  std::mt19937 random(1 + testing::UnitTest::GetInstance()->random_seed());
  const pid_t mpirun = StartRanks(3, arguments);
  // Before, MPI itself may end the ranks that miss one.
  WaitForFile(Path("run") + "/jobs");
  const std::vector<pid_t> ranks = Children(mpirun);
  ASSERT_EQ(ranks.size(), 3u);
  std::this_thread::sleep_for(std::chrono::milliseconds(random() % 700));
  const int victim = static_cast<int>(random() % 3);
  const bool was_killed = ::kill(ranks[victim], SIGKILL) == 0;
  const auto start = std::chrono::steady_clock::now();
  const Output killed = Wait(mpirun);
  while (NumProcesses() > 0) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    const std::chrono::duration<double> seconds =
        std::chrono::steady_clock::now() - start;
    ASSERT_LT(seconds.count(), 60.0) << "ranks go on";
  }
  if (was_killed && killed.exit_code != kSomeFailed) {
    EXPECT_EQ(killed.exit_code, 128 + SIGKILL) << killed.text;
    ExpectSays(killed, {"process rank " + std::to_string(victim)});
  }
  const Output output = RunRanks(2, arguments);
  EXPECT_EQ(output.exit_code, kSomeFailed) << output.text;
  EXPECT_EQ(Losses("run"), Losses("whole"));
  for (const auto& file : fs::recursive_directory_iterator(Path("run"))) {
    EXPECT_EQ(TargetOfTemporary(file.path()), "");
  }
}

}  // namespace sweep_ranks_test
}  // namespace invgrad
