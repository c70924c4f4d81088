// Jobs in processes: order, errors, crashes, interrupts.

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "bin/sweep/processes.h"
#include "gtest/gtest.h"
#include "report/interrupt.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace sweep_processes_test {

using State = ProcessStatus::State;
using Statuses = std::vector<ProcessStatus>;

void Ignore(const Statuses&) {}

TEST(RunInProcesses, RunsEveryJobOnceInAProcessOfItsOwn) {
  const TemporaryFolder folder;
  for (const int num_processes : {1, 3, 20}) {
    int most_running = 0;
    const Statuses statuses = RunInProcesses(
        7,
        num_processes,
        [&](int job, std::string*) {
          std::ofstream(folder / std::to_string(job), std::ios::app)
              << ::getpid() << '\n';
          return true;
        },
        [&](const Statuses& now) {
          most_running = std::max<int>(
              most_running,
              std::count_if(now.begin(), now.end(), [](const auto& status) {
                return status.state == State::kRunning;
              }));
        });
    ASSERT_EQ(statuses.size(), 7u);
    EXPECT_LE(most_running, num_processes);
    for (int job = 0; job < 7; ++job) {
      EXPECT_EQ(statuses[job].state, State::kDone);
      std::ifstream file(folder / std::to_string(job));
      pid_t pid = 0;
      pid_t more = 0;
      file >> pid;
      EXPECT_NE(pid, ::getpid());
      EXPECT_FALSE(file >> more);
      std::filesystem::remove(folder / std::to_string(job));
    }
  }
  EXPECT_TRUE(RunInProcesses(0, 1, nullptr, Ignore).empty());
}

TEST(RunInProcesses, FailuresAndCrashesAreReportedAndTheOthersGoOn) {
  const Statuses statuses = RunInProcesses(
      6,
      2,
      [](int job, std::string* error) {
        if (job == 1) {
          *error = "no such thing";
          return false;
        }
        if (job == 2) std::raise(SIGKILL);
        if (job == 3) throw std::runtime_error("thrown");
        if (job == 4) ::_exit(3);
        return true;
      },
      Ignore);
  EXPECT_EQ(statuses[0].state, State::kDone);
  EXPECT_EQ(statuses[1].state, State::kFailed);
  EXPECT_EQ(statuses[1].message, "no such thing");
  EXPECT_EQ(statuses[2].state, State::kCrashed);
  EXPECT_EQ(statuses[2].message, "ended by signal 9 (Killed)");
  EXPECT_EQ(statuses[3].state, State::kFailed);
  EXPECT_EQ(statuses[3].message, "thrown");
  EXPECT_EQ(statuses[4].state, State::kFailed);
  EXPECT_EQ(statuses[4].message, "ended with exit code 3");
  EXPECT_EQ(statuses[5].state, State::kDone);
}

TEST(RunInProcesses, AnInterruptEndsWhatRunsAndStartsNothing) {
  const Interrupt interrupt;
  const Statuses statuses = RunInProcesses(
      5,
      2,
      [](int job, std::string* error) {
        // Job 0 asks for the end as the user would; both wait for it.
        if (job == 0) ::kill(::getppid(), SIGINT);
        for (int i = 0; i < 2000 && !IsStopRequested(); ++i) {
          std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        *error = "was not told";
        return IsStopRequested();
      },
      Ignore);
  EXPECT_EQ(statuses[0].state, State::kDone) << statuses[0].message;
  for (int job = 2; job < 5; ++job) {
    EXPECT_EQ(statuses[job].state, State::kWaiting);
  }
}

}  // namespace sweep_processes_test
}  // namespace invgrad
