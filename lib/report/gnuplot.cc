#include "report/gnuplot.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <system_error>

#include "fmt/core.h"
#include "fmt/ranges.h"
#include "report/interrupt.h"

namespace invgrad {

// Special characters of gnuplot's double quotes become octal numbers. (gnuplot
// 5.4 misreads a single-quoted string that begins with a quote.)
std::string QuoteForGnuplot(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (code < 0x20 || code == 0x7f) {
      quoted += ' ';
    } else if (std::string_view("\"'`\\@$").find(c) != std::string_view::npos) {
      quoted += fmt::format("\\{:03o}", code);
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

std::string RunGnuplot(const std::string& folder,
                       const std::string& script,
                       double max_seconds) {
  using Clock = std::chrono::steady_clock;
  const std::string path = "./" + script;
  const int signal_before = Interrupt::Signal();
  const auto cannot_run = [] {
    return "cannot run gnuplot: " + std::generic_category().message(errno);
  };
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return cannot_run();
  constexpr int kNotFound = 127, kNotStarted = 126;  // as of a shell
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child == 0) {
    // A group of its own: Ctrl-C goes to the parent, which ends this process.
    // (gnuplot itself goes on after Ctrl-C.)
    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    const int nothing = open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (getppid() == parent && chdir(folder.c_str()) == 0 &&
        dup2(nothing, STDIN_FILENO) >= 0 && dup2(ends[1], STDOUT_FILENO) >= 0 &&
        dup2(ends[1], STDERR_FILENO) >= 0) {
      // Without the settings of the user's ~/.gnuplot.
      execlp("gnuplot",
             "gnuplot",
             "--default-settings",
             path.c_str(),
             static_cast<char*>(nullptr));
      _exit(errno == ENOENT ? kNotFound : kNotStarted);
    }
    _exit(kNotStarted);
  }
  close(ends[1]);
  std::string output, problem;
  if (child < 0) problem = cannot_run();
  const Clock::time_point start = Clock::now();
  bool is_open = child >= 0;
  while (is_open && problem.empty()) {
    constexpr int kWaitInMilliseconds = 50;
    pollfd waiting = {ends[0], POLLIN, 0};
    if (poll(&waiting, 1, kWaitInMilliseconds) > 0) {
      char buffer[4096];
      const ssize_t count = read(ends[0], buffer, sizeof(buffer));
      is_open = count > 0;
      if (is_open) output.append(buffer, count);
    }
    const std::chrono::duration<double> seconds = Clock::now() - start;
    if (Interrupt::Signal() != signal_before) {
      problem = "gnuplot was ended by a signal to this program";
    } else if (seconds.count() > max_seconds) {
      problem = fmt::format("gnuplot took more than {:g} s and was ended",
                            max_seconds);
    }
  }
  close(ends[0]);
  if (child < 0) return problem;
  if (!problem.empty()) {
    setpgid(child, child);  // if the child has not done it yet
    kill(-child, SIGKILL);
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (!problem.empty()) return problem;
  if (WIFSIGNALED(status)) {
    return fmt::format("gnuplot was ended by signal {}", WTERMSIG(status));
  }
  if (WEXITSTATUS(status) == kNotFound) {
    return "gnuplot is not installed (apt install gnuplot-nox)";
  }
  return WEXITSTATUS(status) == 0 ? "" : "gnuplot failed: " + output;
}

}  // namespace invgrad
