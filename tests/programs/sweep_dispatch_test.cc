// Jobs in processes of their own, one after the other: order, errors, crashes,
// signals. sweep_ranks_test.cc has several ranks.

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "bin/sweep/dispatch.h"
#include "gtest/gtest.h"
#include "report/interrupt.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace sweep_dispatch_test {

using State = JobStatus::State;
using Statuses = std::vector<JobStatus>;

bool Ready(int /*job*/, std::string* /*error*/) { return true; }
void Ignore(const Statuses&) {}

Statuses RunAll(int num_jobs, const RunOfJob& run) {
  Schedule schedule(std::vector<Schedule::Job>(num_jobs, {"", 1.0}));
  Dispatcher dispatcher(run);
  return dispatcher.Run(&schedule, Ready, Ignore);
}

TEST(Dispatcher, RunsEveryJobOnceInAProcessOfItsOwnTheLongestFirst) {
  const TemporaryFolder folder;
  const std::string file = folder / "jobs";
  Schedule schedule({{"", 1.0}, {"", 3.0}, {"", 2.0}});
  Dispatcher dispatcher([&file](int job, std::string*) {
    std::ofstream(file, std::ios::app) << job << ' ' << ::getpid() << '\n';
    return true;
  });
  int most_running = 0;
  const Statuses statuses =
      dispatcher.Run(&schedule, Ready, [&](const Statuses& now) {
        int num_running = 0;
        for (const JobStatus& status : now) {
          num_running += status.state == State::kRunning ? 1 : 0;
        }
        most_running = std::max(most_running, num_running);
      });
  EXPECT_EQ(most_running, 1);
  for (const JobStatus& status : statuses) {
    EXPECT_EQ(status.state, State::kEnded);
    EXPECT_EQ(status.error, "");
  }
  std::ifstream lines(file);
  for (const int expected : {1, 2, 0}) {
    int job = -1;
    pid_t pid = 0;
    lines >> job >> pid;
    EXPECT_EQ(job, expected);
    EXPECT_NE(pid, ::getpid());
  }
  std::string more;
  EXPECT_FALSE(lines >> more);
  EXPECT_TRUE(RunAll(0, nullptr).empty());
}

TEST(Dispatcher, FailuresAndCrashesAreReportedAndTheOthersGoOn) {
  const Statuses statuses = RunAll(7, [](int job, std::string* error) {
    if (job == 1) {
      *error = "no such thing";
      return false;
    }
    if (job == 2) std::raise(SIGKILL);
    if (job == 3) throw std::runtime_error("thrown");
    if (job == 4) ::_exit(3);
    if (job == 5) throw std::bad_alloc();
    *error = "of a job that worked";
    return true;
  });
  const std::vector<std::string> errors = {"",
                                           "no such thing",
                                           "ended by signal 9 (Killed)",
                                           "thrown",
                                           "ended with exit code 3",
                                           "there is not enough memory",
                                           ""};
  for (int job = 0; job < 7; ++job) {
    EXPECT_EQ(statuses[job].state, State::kEnded);
    EXPECT_EQ(statuses[job].error, errors[job]);
  }
}

TEST(Dispatcher, AJobThatCannotBePreparedIsNotRun) {
  Schedule schedule({{"", 1.0}, {"", 1.0}});
  Dispatcher dispatcher([](int job, std::string*) { return job == 1; });
  const Statuses statuses = dispatcher.Run(
      &schedule,
      [](int job, std::string* error) {
        *error = job == 0 ? "no space" : "";
        return job == 1;
      },
      Ignore);
  EXPECT_EQ(statuses[0].error, "no space");
  EXPECT_EQ(statuses[1].error, "");
}

TEST(Dispatcher, ASignalEndsWhatRunsAndStartsNothing) {
  const TemporaryFolder folder;
  const std::string file = folder / "end";
  const Interrupt interrupt(/*is_silent=*/true);
  const Statuses statuses = RunAll(5, [&file](int job, std::string* error) {
    // Job 0 signals to the parent as the user would, and waits for its end.
    if (job == 0) ::kill(::getppid(), SIGINT);
    for (int i = 0; i < 2000 && !Interrupt::IsRequested(); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    std::ofstream(file) << Interrupt::Signal();
    *error = "was not told";
    return Interrupt::IsRequested();
  });
  EXPECT_EQ(statuses[0].error, "");
  for (int job = 1; job < 5; ++job) {
    EXPECT_EQ(statuses[job].state, State::kWaiting);
  }
  int signal_number = 0;  // of the job, which has ended
  std::ifstream(file) >> signal_number;
  EXPECT_EQ(signal_number, SIGTERM);
}

TEST(ChildProcess, EndsWithItsParent) {
  const TemporaryFolder folder;
  const std::string file = folder / "pid";
  const pid_t parent = ::fork();
  if (parent == 0) {
    ChildProcess child;
    std::string error;
    child.Start(
        [&file](std::string*) {
          std::ofstream(file) << ::getpid() << '\n';
          for (;;) ::pause();
          return true;
        },
        &error);
    for (;;) ::pause();
  }
  pid_t child = 0;
  for (int i = 0; i < 3000 && child == 0; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    std::string end;
    std::ifstream stream(file);
    if (!(stream >> child) || !std::getline(stream, end)) child = 0;
  }
  ASSERT_NE(child, 0);
  ::kill(parent, SIGKILL);
  ::waitpid(parent, nullptr, 0);
  // Nobody may be there to collect it: dead is enough.
  char state = 'R';
  for (int i = 0; i < 3000 && state != 'Z' && state != 0; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    std::ifstream stream("/proc/" + std::to_string(child) + "/stat");
    std::string pid, name;
    state = 0;
    stream >> pid >> name >> state;
  }
  EXPECT_TRUE(state == 'Z' || state == 0) << state;
}

}  // namespace sweep_dispatch_test
}  // namespace invgrad
