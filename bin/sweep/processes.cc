#include "bin/sweep/processes.h"

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <thread>

#include "glog/logging.h"
#include "report/interrupt.h"

namespace invgrad {

namespace {

using Clock = std::chrono::steady_clock;

// 0 outside of a job.
pid_t parent_of_job = 0;

struct Child {
  int job = 0;
  pid_t pid = 0;
  int message_pipe = -1;  // what the job's error says
  Clock::time_point start;
};

// Runs the job and ends the process.
[[noreturn]] void RunJob(
    int job,
    int message_pipe,
    const std::function<bool(int job, std::string* error)>& run) {
  // Leaves the terminal's process group: only the parent receives Ctrl-C, so
  // that a job gets one signal, not two.
  ::setpgid(0, 0);
  std::string error;
  bool is_done = false;
  try {
    is_done = run(job, &error);
  } catch (const std::exception& exception) {
    error = exception.what();
  }
  // A pipe holds this much whether or not it is being read.
  constexpr size_t kMaxLength = 4096;
  error = error.substr(0, kMaxLength);
  if (::write(message_pipe, error.data(), error.size()) < 0) is_done = false;
  std::fflush(nullptr);
  // Not exit, which would run the parent's exit handlers.
  ::_exit(is_done ? 0 : 1);
}

bool StartJob(int job,
              const std::function<bool(int job, std::string* error)>& run,
              Child* child,
              std::string* error) {
  int ends[2];
  if (::pipe(ends) != 0) {
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
    parent_of_job = parent;
    RunJob(job, ends[1], run);
  }
  ::close(ends[1]);
  *child = {job, pid, ends[0], Clock::now()};
  return true;
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

// Whether the child has ended; then *status says how.
bool HasEnded(const Child& child, ProcessStatus* status) {
  int how = 0;
  if (::waitpid(child.pid, &how, WNOHANG) != child.pid) {
    status->seconds =
        std::chrono::duration<double>(Clock::now() - child.start).count();
    return false;
  }
  status->message = ReadAll(child.message_pipe);
  ::close(child.message_pipe);
  if (WIFSIGNALED(how)) {
    const int signal_number = WTERMSIG(how);
    status->state = ProcessStatus::State::kCrashed;
    status->message = "ended by signal " + std::to_string(signal_number) +
                      " (" + ::strsignal(signal_number) + ")";
  } else if (WEXITSTATUS(how) == 0) {
    status->state = ProcessStatus::State::kDone;
  } else {
    status->state = ProcessStatus::State::kFailed;
    if (status->message.empty()) {
      status->message =
          "ended with exit code " + std::to_string(WEXITSTATUS(how));
    }
  }
  return true;
}

}  // namespace

std::vector<ProcessStatus> RunInProcesses(
    int num_jobs,
    int num_processes,
    const std::function<bool(int job, std::string* error)>& run,
    const std::function<void(const std::vector<ProcessStatus>&)>& on_wait) {
  CHECK_GE(num_processes, 1);
  std::vector<ProcessStatus> statuses(num_jobs);
  std::vector<Child> children;
  int next = 0;
  bool was_told = false;
  while (true) {
    const bool may_start = !Interrupt::IsRequested();
    while (may_start && next < num_jobs &&
           static_cast<int>(children.size()) < num_processes) {
      Child child;
      ProcessStatus& status = statuses[next];
      if (StartJob(next, run, &child, &status.message)) {
        status.state = ProcessStatus::State::kRunning;
        children.push_back(child);
      } else {
        status.state = ProcessStatus::State::kFailed;
      }
      ++next;
    }
    if (children.empty()) return statuses;
    if (!may_start && !was_told) {
      for (const Child& child : children) ::kill(child.pid, SIGINT);
      was_told = true;
    }
    const auto has_ended = [&statuses](const Child& child) {
      return HasEnded(child, &statuses[child.job]);
    };
    const auto end =
        std::remove_if(children.begin(), children.end(), has_ended);
    if (end == children.end()) {
      constexpr std::chrono::milliseconds kPause(10);
      std::this_thread::sleep_for(kPause);
    }
    children.erase(end, children.end());
    on_wait(statuses);
  }
}

bool IsStopRequested() {
  return Interrupt::IsRequested() ||
         (parent_of_job != 0 && ::getppid() != parent_of_job);
}

}  // namespace invgrad
