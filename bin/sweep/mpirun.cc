#include "bin/sweep/mpirun.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "bin/support/program.h"
#include "bin/support/ranks.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "glog/logging.h"
#include "report/interrupt.h"

namespace invgrad {
namespace {

// The file that takes the exit code.
constexpr char kExitCodeFile[] = "INVGRAD_EXIT_CODE_FILE";
constexpr int kNotFound = 127;
constexpr char kGoesOn[] = "the same command goes on with what is missing";

[[noreturn]] void Execute(pid_t parent, int num_ranks) {
  // Of Ctrl-C, the parent sends one signal.
  ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
  ::dup2(::open("/dev/null", O_RDONLY), STDIN_FILENO);
  const bool is_root = ::geteuid() == 0;
  for (const char* name : {"OMPI_MCA_rmaps_base_oversubscribe",
                           "OMPI_ALLOW_RUN_AS_ROOT",
                           "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"}) {
    if (is_root || name[5] == 'M') ::setenv(name, "1", /*overwrite=*/0);
  }
  // Two sweeps would have the same cores.
  ::setenv("OMPI_MCA_hwloc_base_binding_policy", "none", /*overwrite=*/0);
  std::vector<std::string> words = gflags::GetArgvs();
  words[0] = std::filesystem::read_symlink("/proc/self/exe");
  words.insert(words.begin(), {"mpirun", "-n", std::to_string(num_ranks)});
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  ::execvp(argv[0], argv.data());
  ::_exit(kNotFound);
}

}  // namespace

void RunByMpirun(int num_ranks) {
  if (!kHasMpi) return;
  using Clock = std::chrono::steady_clock;
  int ends[2];
  CHECK_EQ(::pipe2(ends, O_CLOEXEC | O_NONBLOCK), 0);
  const pid_t parent = ::getpid();
  ::setenv(kExitCodeFile,
           fmt::format("/proc/{}/fd/{}", parent, ends[1]).c_str(),
           /*overwrite=*/1);
  const Interrupt interrupt(/*is_silent=*/true);
  const pid_t mpirun = ::fork();
  PCHECK(mpirun >= 0) << "cannot start a process";
  if (mpirun == 0) Execute(parent, num_ranks);
  int status = 0;
  Clock::time_point next_signal;
  while (::waitpid(mpirun, &status, WNOHANG) == 0) {
    constexpr std::chrono::milliseconds kPause(10);
    std::this_thread::sleep_for(kPause);
    // mpirun passes on SIGUSR1 alone, and only to ranks that are there.
    if (Interrupt::IsRequested() && Clock::now() >= next_signal) {
      ::kill(mpirun, SIGUSR1);
      next_signal = Clock::now() + std::chrono::seconds(1);
    }
  }
  int exit_code =
      WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  if (exit_code == kNotFound) {
    ::unsetenv(kExitCodeFile);
    return;
  }
  unsigned char handed_over = 0;
  if (Interrupt::IsRequested()) {
    exit_code = 128 + Interrupt::Signal();
    Warn(kGoesOn);
  } else if (exit_code != 0) {
    Warn(fmt::format("mpirun ended with exit code {}; {}", exit_code, kGoesOn));
  } else if (::read(ends[0], &handed_over, 1) == 1) {
    exit_code = handed_over;
  }
  std::exit(exit_code);
}

int HandOverExitCode(int exit_code) {
  const char* const file = std::getenv(kExitCodeFile);
  if (file == nullptr) return exit_code;
  if (IsFirstRank()) {
    std::ofstream stream(file);
    if (!stream.put(static_cast<char>(exit_code)).flush()) return exit_code;
  }
  return 0;
}

void WarnOfInterrupt() {
  if (std::getenv(kExitCodeFile) == nullptr) Warn(kGoesOn);
}

}  // namespace invgrad
