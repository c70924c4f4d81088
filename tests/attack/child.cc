#include "tests/attack/child.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <memory>

#include "fmt/core.h"
#include "glog/logging.h"
#include "gtest/gtest.h"
#include "tests/support/address_limit.h"
#include "tests/support/source_tree.h"

namespace invgrad {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kMaxAddresses = kCanLimitAddresses ? 6e9 : 0.0;
// A sanitizer is slow.
constexpr double kMaxSeconds = kCanLimitAddresses ? 20.0 : 200.0;
constexpr double kMaxMemory = 1.5e9;

[[noreturn]] void Execute(const Command& command, int output, int to_parent) {
  setpgid(0, 0);
  rlimit limit{0, 0};
  setrlimit(RLIMIT_CORE, &limit);
  if (kMaxAddresses > 0.0) {
    limit.rlim_cur = limit.rlim_max = static_cast<rlim_t>(kMaxAddresses);
    setrlimit(RLIMIT_AS, &limit);
  }
  dup2(open("/dev/null", O_RDONLY), STDIN_FILENO);
  dup2(output, STDOUT_FILENO);
  dup2(output, STDERR_FILENO);
  if (!command.output.empty()) {
    dup2(open(command.output.c_str(), O_WRONLY), STDOUT_FILENO);
  }
  if (chdir(command.folder.c_str()) != 0) _exit(126);
  for (const std::string& variable : command.environment) {
    putenv(const_cast<char*>(variable.c_str()));  // NOLINT: as POSIX has it
  }
  std::vector<std::string> words = {BinDir() + "/" + command.program};
  words.insert(words.end(), command.arguments.begin(), command.arguments.end());
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  if (command.fault.has_value()) {
    const int listener = InstallFileCallFilter();
    char is_taken = 0;
    // Neither call is one of those that wait for the parent.
    if (send(to_parent, &listener, sizeof(listener), 0) < 0 ||
        recv(to_parent, &is_taken, 1, 0) != 1) {
      _exit(126);
    }
  }
  execv(argv[0], argv.data());
  _exit(127);
}

// Null if the kernel does not permit the filter.
std::unique_ptr<FileCalls> TakeCalls(pid_t child,
                                     int from_child,
                                     const Command& command) {
  int listener = -1;
  if (recv(from_child, &listener, sizeof(listener), 0) != sizeof(listener) ||
      listener < 0) {
    return nullptr;
  }
  auto calls = std::make_unique<FileCalls>(
      TakeDescriptor(child, listener), command.folder, *command.fault);
  const char is_taken = 1;
  return send(from_child, &is_taken, 1, 0) == 1 ? std::move(calls) : nullptr;
}

// Children of children that outlive their parents become ours.
void KillChildren() {
  std::ifstream list(fmt::format("/proc/self/task/{}/children", gettid()));
  for (pid_t child = 0; list >> child;) kill(child, SIGKILL);
}

std::string ReadFrom(int file) {
  std::string text(lseek(file, 0, SEEK_END), '\0');
  const ssize_t size = pread(file, text.data(), text.size(), 0);
  text.resize(std::max<ssize_t>(size, 0));
  return text;
}

}  // namespace

Outcome RunChild(const Command& command) {
  static const bool adopts = prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0) == 0;
  CHECK(adopts);
  Outcome outcome;
  const int output = memfd_create("output", MFD_CLOEXEC);
  int ends[2];
  CHECK_GE(output, 0);
  CHECK_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends), 0);
  const Clock::time_point start = Clock::now();
  const auto elapsed = [start]() {
    return std::chrono::duration<double>(Clock::now() - start).count();
  };
  const pid_t child = fork();
  if (child == 0) Execute(command, output, ends[1]);
  std::unique_ptr<FileCalls> calls;
  if (command.fault.has_value()) {
    calls = TakeCalls(child, ends[0], command);
    CHECK(calls != nullptr) << "this kernel does not report system calls";
  }
  close(ends[0]);
  close(ends[1]);
  bool was_signalled = command.signal == 0;
  // Until there is neither the program nor a child that it left.
  for (pid_t ended = 0; ended >= 0;) {
    int status = 0;
    rusage usage{};
    ended = wait4(-1, &status, WNOHANG, &usage);
    if (ended == child) {
      outcome.seconds = elapsed();
      outcome.peak_bytes = 1024.0 * static_cast<double>(usage.ru_maxrss);
      if (WIFEXITED(status)) outcome.exit_code = WEXITSTATUS(status);
      if (WIFSIGNALED(status)) outcome.signal = WTERMSIG(status);
    }
    if (ended != 0) continue;
    if (!was_signalled && elapsed() >= command.signal_after) {
      kill(child, command.signal);
      was_signalled = true;
    }
    if (elapsed() > kMaxSeconds) {
      outcome.was_late = true;
      KillChildren();
    }
    if (calls != nullptr && !calls->has_ended()) {
      calls->Serve(1);
    } else {
      usleep(200);
    }
  }
  if (calls != nullptr) {
    outcome.calls = calls->names();
    outcome.had_fault = calls->had_fault();
  }
  outcome.text = ReadFrom(output);
  close(output);
  EXPECT_FALSE(outcome.was_late) << "hangs: " << ShellLine(command);
  EXPECT_LT(outcome.peak_bytes, kMaxMemory) << ShellLine(command);
  return outcome;
}

std::string ShellLine(const Command& command) {
  std::string line = "cd " + command.folder + "; ";
  for (const std::string& variable : command.environment) {
    line += variable + " ";
  }
  line += command.program;
  constexpr size_t kMaxLength = 300;
  for (const std::string& argument : command.arguments) {
    line += " '" + argument.substr(0, kMaxLength) +
            (argument.size() > kMaxLength ? "..." : "") + "'";
  }
  return line;
}

}  // namespace invgrad
