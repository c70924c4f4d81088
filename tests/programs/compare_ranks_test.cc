// compare on several ranks of MPI: the same results, one message of all ranks,
// and nothing lost when a rank is killed.

#include <chrono>
#include <csignal>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/npy.h"
#include "tests/programs/compare_program.h"
#include "tests/support/mpirun.h"

namespace invgrad {
namespace compare_ranks_test {

using Words = std::vector<std::string>;
using Clock = std::chrono::steady_clock;

class CompareRanks : public CompareProgram {
 protected:
  void SetUp() override {
    if (!PrepareMpirun()) GTEST_SKIP() << kNoMpi;
  }

  pid_t StartRanks(int num_ranks, const Words& arguments) const {
    return StartCommand(
        MpirunCommand(num_ranks, BinDir() + "/compare", arguments));
  }
  Output RunRanks(int num_ranks, const Words& arguments) const {
    return Wait(StartRanks(num_ranks, arguments));
  }

  Eigen::VectorXd Weights(const std::string& run) const {
    Eigen::VectorXd weights;
    std::string error;
    EXPECT_TRUE(ReadNpy(Path(run) + "/weights.npy", -1, &weights, &error))
        << error;
    return weights;
  }
};

TEST_F(CompareRanks, TrainAsOneProcess) {
  ASSERT_EQ(Run(SmallRun("alone")).exit_code, 0);
  const Output output = RunRanks(3, SmallRun("together"));
  ASSERT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"3 ranks", "results in"});
  const Eigen::VectorXd alone = Weights("alone/adam-step_size-1e-2-seed1");
  const Eigen::VectorXd together =
      Weights("together/adam-step_size-1e-2-seed1");
  EXPECT_LE((alone - together).norm(), 1e-10 * alone.norm());
  // One process resumes the run of three.
  Words more = SmallRun("together");
  more[2] = "--epochs=5";
  more.push_back("--resume");
  const Output resumed = Run(more);
  EXPECT_EQ(resumed.exit_code, 0) << resumed.text;
}

TEST_F(CompareRanks, RefuseWhatRanksCannotShare) {
  Words arguments = SmallRun("refused");
  arguments[3] = "--batch_size=2";
  arguments[1] = "--rules=adam,ceres_lm";
  const Output output = RunRanks(3, arguments);
  EXPECT_EQ(output.exit_code, 3) << output.text;  // all runs failed
  ExpectSays(output,
             {"batch_size=2 is less than the 3 ranks",
              "a minimizer of Ceres works in one process"});
}

// kill -9 of a random rank at a random moment: all ranks end, and the resumed run
// ends where an undisturbed one does, bit for bit. --gtest_repeat with
// --gtest_shuffle does it more often, at other moments.
TEST_F(CompareRanks, KilledRanksLoseNothing) {
  const auto run = [this](const std::string& output) -> Words {
    return {"--problem=oscillator_chain:num_samples=256",
            "--rules=half_inverse:truncation=1e-3",
            "--steps=600",
            "--batch_size=32",
            "--plots=false",
            "--checkpoint_seconds=0.05",
            "--output=" + Path(output)};
  };
  ASSERT_EQ(RunRanks(2, run("whole")).exit_code, 0);
  const std::string name = "/half_inverse-truncation-1e-3-seed1";
  std::mt19937 random(1 + testing::UnitTest::GetInstance()->random_seed());
  const pid_t mpirun = StartRanks(2, run("killed"));
  // Before, MPI itself may end the rank that misses the other.
  WaitForFile(Path("killed"));
  const std::vector<pid_t> ranks = Children(mpirun);
  std::this_thread::sleep_for(std::chrono::milliseconds(random() % 400));
  const std::size_t rank = random() % 2;
  const bool is_killed =
      rank < ranks.size() && ::kill(ranks[rank], SIGKILL) == 0;
  const Clock::time_point start = Clock::now();
  const Output killed = Wait(mpirun);
  EXPECT_LT(Clock::now() - start, std::chrono::seconds(10));
  if (is_killed && killed.exit_code != 0) {
    ExpectSays(killed, {"process rank " + std::to_string(rank), "signal 9"});
  }
  Words again = run("killed");
  again.emplace_back("--resume");
  const Output resumed = RunRanks(2, again);
  EXPECT_EQ(resumed.exit_code, 0) << resumed.text << killed.text;
  EXPECT_EQ(Weights("killed" + name), Weights("whole" + name));
}

}  // namespace compare_ranks_test
}  // namespace invgrad
