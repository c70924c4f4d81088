// A system call that changes a file fails: the program says so, every file is
// the old or the new one, and the run can go on.

#include <cerrno>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/attack/attack.h"
#include "tests/attack/child.h"
#include "tests/attack/run_files.h"
#include "tests/attack/runs.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace write_failure_test {

Fault AnyFault(int num_calls, Dice* dice) {
  const int call = 1 + dice->Below(num_calls);
  if (dice->OneIn(6)) return {Fault::Kind::kShortWrite, call, 0};
  return {Fault::Kind::kError,
          call,
          dice->Pick(std::vector<int>{
              ENOSPC, ENOSPC, EIO, EINTR, EDQUOT, EROFS, EACCES})};
}

std::string Name(const Fault& fault) {
  return fault.kind == Fault::Kind::kShortWrite
             ? "short write"
             : std::string(std::strerror(fault.error_number));
}

TEST(WriteFailureAttack, FailuresAreReportedAndHarmless) {
  if (!CanReportFileCalls()) {
    GTEST_SKIP() << "this kernel does not report system calls";
  }
  Attack([](Dice* dice) {
    const TemporaryFolder folder;
    Command command = AnyRun(folder / "", dice);
    // Half of them go on with a shorter run.
    Files old;
    if (command.program == "compare" && dice->OneIn(2)) {
      Command shorter = command;
      shorter.arguments.push_back("--epochs=2");
      RunChild(shorter);
      old = ReadFiles(folder / "run");
      command = Resumed(command);
    }
    command.fault = Fault();
    const Outcome whole = RunChild(command);
    if (whole.calls.empty()) {  // such as a method that the problem does not
                                // have
      Count("refused");
      return;
    }
    const Files expected = Results(ReadFiles(folder / "run"));
    constexpr int kNumFaults = 5;
    for (int i = 0; i < kNumFaults; ++i) {
      WriteFiles(old, folder / "run");
      const Fault fault = AnyFault(static_cast<int>(whole.calls.size()), dice);
      command.fault = fault;
      const Outcome outcome = RunChild(command);
      if (!outcome.had_fault) continue;
      const std::string what = outcome.calls[fault.call - 1] + " number " +
                               std::to_string(fault.call) + ": " + Name(fault);
      SCOPED_TRACE(what + "\n" + ShellLine(command));
      Count("faults");
      EXPECT_EQ(outcome.signal, 0) << outcome.text;
      const Files files = ReadFiles(folder / "run");
      const bool is_reported =
          outcome.text.find(Name(fault)) != std::string::npos;
      // A run without its checkpoint or its report goes on, and says so.
      if (!is_reported || outcome.exit_code == 0) {
        Count("overcome");
        EXPECT_EQ(outcome.exit_code, whole.exit_code) << outcome.text;
        EXPECT_TRUE(!is_reported ||
                    outcome.text.find("/checkpoint: ") != std::string::npos ||
                    outcome.text.find("/report.html: ") != std::string::npos)
            << outcome.text;
        EXPECT_EQ(FindDifference(Results(files), expected), "") << outcome.text;
      } else {
        const Files before = Results(old);
        for (const auto& [name, content] : Results(files)) {
          const bool is_old =
              before.count(name) > 0 && content == before.at(name);
          const bool is_new =
              expected.count(name) > 0 && content == expected.at(name);
          const bool reports_it =
              content.find(Name(fault)) != std::string::npos;
          EXPECT_TRUE(is_old || is_new || reports_it)
              << name << " is neither old nor new: " << content;
        }
      }
      const bool is_removal = what.rfind("unlink", 0) == 0;
      if (!is_removal) {
        EXPECT_EQ(TemporaryFiles(files), std::vector<std::string>());
      }
      // Without a fault it goes on.
      command.fault.reset();
      const Outcome resumed = RunChild(Resumed(command));
      EXPECT_EQ(resumed.exit_code, whole.exit_code)
          << outcome.text << "\nresumed: " << resumed.text;
      EXPECT_EQ(FindDifference(Results(ReadFiles(folder / "run")), expected),
                "")
          << outcome.text << "\nresumed: " << resumed.text;
    }
  });
}

}  // namespace write_failure_test
}  // namespace invgrad
