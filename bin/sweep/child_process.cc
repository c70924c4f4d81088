#include "bin/sweep/child_process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <fstream>
#include <new>

#include "glog/logging.h"

namespace invgrad {

namespace {

// Runs the job and ends the process.
[[noreturn]] void RunJob(pid_t parent,
                         int message_pipe,
                         const std::function<bool(std::string* error)>& job) {
  // Leaves the terminal's process group: only the parent receives Ctrl-C, so
  // that a job gets one signal, not two.
  ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
  // Where memory ends, the job is killed, not its parent.
  std::ofstream("/proc/self/oom_score_adj") << 500;
  std::string error;
  bool is_done = false;
  try {
    is_done = job(&error);
  } catch (const std::bad_alloc&) {
    error = "there is not enough memory";
  } catch (const std::exception& exception) {
    error = exception.what();
  }
  if (is_done) error.clear();
  // A pipe holds this much whether or not it is being read.
  constexpr size_t kMaxLength = 4096;
  error = error.substr(0, kMaxLength);
  if (::write(message_pipe, error.data(), error.size()) < 0) is_done = false;
  std::fflush(nullptr);
  // Not exit, which would run the parent's exit handlers.
  ::_exit(is_done ? 0 : 1);
}

std::string ReadAll(int file) {
  std::string text;
  char buffer[4096];
  ssize_t count = 0;
  while ((count = ::read(file, buffer, sizeof(buffer))) > 0 ||
         (count < 0 && errno == EINTR)) {
    text.append(buffer, std::max<ssize_t>(count, 0));
  }
  return text;
}

}  // namespace

ChildProcess::~ChildProcess() {
  if (!is_running()) return;
  ::kill(pid_, SIGKILL);
  ::waitpid(pid_, nullptr, 0);
  ::close(message_pipe_);
}

bool ChildProcess::Start(const std::function<bool(std::string* error)>& job,
                         std::string* error) {
  CHECK(!is_running());
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) {
    *error = std::string("cannot start a process: ") + std::strerror(errno);
    return false;
  }
  std::fflush(nullptr);  // otherwise the child prints the buffer again
  const pid_t parent = ::getpid();
  const pid_t pid = ::fork();
  if (pid < 0) {
    *error = std::string("cannot start a process: ") + std::strerror(errno);
    ::close(ends[0]);
    ::close(ends[1]);
    return false;
  }
  if (pid == 0) {
    ::close(ends[0]);
    RunJob(parent, ends[1], job);
  }
  ::close(ends[1]);
  pid_ = pid;
  message_pipe_ = ends[0];
  is_stopped_ = false;
  return true;
}

bool ChildProcess::HasEnded(std::string* message) {
  int how = 0;
  if (!is_running() || ::waitpid(pid_, &how, WNOHANG) != pid_) return false;
  *message = ReadAll(message_pipe_);
  ::close(message_pipe_);
  pid_ = 0;
  if (WIFSIGNALED(how)) {
    const int signal_number = WTERMSIG(how);
    *message = "ended by signal " + std::to_string(signal_number) + " (" +
               ::strsignal(signal_number) + ")";
  } else if (WEXITSTATUS(how) != 0 && message->empty()) {
    *message = "ended with exit code " + std::to_string(WEXITSTATUS(how));
  }
  return true;
}

void ChildProcess::Stop() {
  if (is_running() && !is_stopped_) ::kill(pid_, SIGTERM);
  is_stopped_ = true;
}

}  // namespace invgrad
