// Runs that are killed and go on end as if nothing had happened.

#include <csignal>
#include <filesystem>
#include <string>

#include "gtest/gtest.h"
#include "tests/attack/attack.h"
#include "tests/attack/child.h"
#include "tests/attack/run_files.h"
#include "tests/attack/runs.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace kill_test {

// Between two system calls that change files, or at any moment.
void KillAnywhere(const Outcome& whole, Dice* dice, Command* command) {
  if (CanReportFileCalls() && dice->OneIn(2)) {
    const auto num_calls = static_cast<int>(whole.calls.size());
    command->fault = Fault{Fault::Kind::kKill, 1 + dice->Below(num_calls), 0};
    return;
  }
  command->signal =
      dice->Pick(std::vector<int>{SIGKILL, SIGKILL, SIGTERM, SIGINT, SIGHUP});
  command->signal_after = dice->Fraction() * whole.seconds;
}

TEST(KillAttack, KilledRunsGoOnToTheSameBits) {
  Attack([](Dice* dice) {
    const TemporaryFolder folder;
    Command command = AnyRun(folder / "", dice);
    SCOPED_TRACE(ShellLine(command));
    if (CanReportFileCalls()) command.fault = Fault();
    const Outcome whole = RunChild(command);
    if (whole.calls.empty() && command.fault.has_value()) {
      Count("refused");  // such as a method that the problem does not have
      EXPECT_EQ(whole.exit_code, 1) << whole.text;
      return;
    }
    command.fault.reset();
    const Files expected = Results(ReadFiles(folder / "run"));
    std::filesystem::remove_all(folder / "run");

    std::string story;
    const int num_kills = 1 + dice->Below(4);
    for (int i = 0; i < num_kills; ++i) {
      Command killed = i == 0 ? command : Resumed(command);
      KillAnywhere(whole, dice, &killed);
      const Outcome outcome = RunChild(killed);
      const bool was_killed = outcome.signal != 0;
      Count(was_killed               ? "killed"
            : outcome.exit_code == 0 ? "were done before"
                                     : "stopped");
      story += "\nexit code " + std::to_string(outcome.exit_code) +
               ", signal " + std::to_string(outcome.signal) + " of " +
               std::to_string(killed.signal) + " " + outcome.text;
      // It ends at once, in its own time, or is done.
      EXPECT_TRUE(
          outcome.signal == SIGKILL || outcome.signal == killed.signal ||
          outcome.exit_code == 128 + killed.signal ||
          outcome.exit_code == whole.exit_code || killed.fault.has_value())
          << story;
    }
    const Outcome last = RunChild(Resumed(command));
    EXPECT_EQ(last.exit_code, whole.exit_code) << story << last.text;
    const Files files = ReadFiles(folder / "run");
    EXPECT_EQ(FindDifference(Results(files), expected), "")
        << story << last.text << "\nuninterrupted: " << whole.text;
    EXPECT_EQ(TemporaryFiles(files), std::vector<std::string>());
  });
}

}  // namespace kill_test
}  // namespace invgrad
