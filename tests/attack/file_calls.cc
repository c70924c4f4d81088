#include "tests/attack/file_calls.h"

#include <fcntl.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "fmt/core.h"

namespace invgrad {
namespace {

enum class Subject {
  kFile,    // the first argument is a descriptor
  kPath,    // of a file that the call creates, moves or removes
  kOpen,    // a path, and flags as the second argument
  kOpenAt,  // ... as the third argument
};

struct CallRow {
  int number;
  const char* name;
  Subject subject;
};

constexpr CallRow kCalls[] = {
    {SYS_write, "write", Subject::kFile},
    {SYS_writev, "writev", Subject::kFile},
    {SYS_pwrite64, "pwrite", Subject::kFile},
    {SYS_ftruncate, "ftruncate", Subject::kFile},
    {SYS_fsync, "fsync", Subject::kFile},
    {SYS_fdatasync, "fdatasync", Subject::kFile},
    {SYS_close, "close", Subject::kFile},
    {SYS_openat, "openat", Subject::kOpenAt},
    {SYS_mkdirat, "mkdirat", Subject::kPath},
    {SYS_unlinkat, "unlinkat", Subject::kPath},
    {SYS_renameat, "renameat", Subject::kPath},
    {SYS_renameat2, "renameat2", Subject::kPath},
#ifdef SYS_open  // some processors have only the calls above
    {SYS_open, "open", Subject::kOpen},
    {SYS_mkdir, "mkdir", Subject::kPath},
    {SYS_unlink, "unlink", Subject::kPath},
    {SYS_rmdir, "rmdir", Subject::kPath},
    {SYS_rename, "rename", Subject::kPath},
#endif
};

// What a line of a file in /proc says after `key`.
std::string ProcField(const std::string& path, const std::string& key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.rfind(key, 0) == 0) return line.substr(key.size());
  }
  return "";
}

bool ChangesFiles(long flags) {
  return (flags & (O_WRONLY | O_RDWR | O_CREAT | O_TRUNC)) != 0;
}

// The text at an address of the process; what can be read of it.
std::string TextAt(pid_t process, std::uint64_t address) {
  constexpr std::uint64_t kPage = 4096;
  std::string text;
  while (text.find('\0') == std::string::npos) {
    std::string page(kPage - address % kPage, '\0');
    const iovec here{page.data(), page.size()};
    const iovec there{reinterpret_cast<void*>(address),  // NOLINT: see below
                      page.size()};
    if (process_vm_readv(process, &here, 1, &there, 1, 0) <= 0) break;
    text += page;
    address += page.size();
  }
  return text.substr(0, text.find('\0'));
}

// Whether the descriptor is open for writing, or a folder, below `folder`.
bool IsFileBelow(const std::string& folder, pid_t process, int file) {
  char target[4096];
  const ssize_t length =
      readlink(fmt::format("/proc/{}/fd/{}", process, file).c_str(),
               target,
               sizeof(target));
  if (length < 0 || std::string(target, length).rfind(folder, 0) != 0) {
    return false;
  }
  const std::string flags =
      ProcField(fmt::format("/proc/{}/fdinfo/{}", process, file), "flags:");
  return ChangesFiles(std::strtol(flags.c_str(), nullptr, 8));
}

pid_t ProcessOfThread(pid_t thread) {
  return std::atoi(
      ProcField(fmt::format("/proc/{}/status", thread), "Tgid:").c_str());
}

}  // namespace

bool CanReportFileCalls() {
  const pid_t child = fork();
  if (child == 0) {
    if (InstallFileCallFilter() >= 0) raise(SIGSTOP);
    _exit(1);
  }
  int status = 0;
  waitpid(child, &status, WUNTRACED);
  if (!WIFSTOPPED(status)) return false;
  const int taken = TakeDescriptor(child, STDERR_FILENO);
  close(taken);
  kill(child, SIGKILL);
  waitpid(child, &status, 0);
  return taken >= 0;
}

int InstallFileCallFilter() {
  constexpr int kNumCalls = std::size(kCalls);
  sock_filter program[kNumCalls + 3];
  program[0] = BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr));
  for (int i = 0; i < kNumCalls; ++i) {
    // Jumps over the other comparisons and the next return.
    program[1 + i] = BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K,
                              static_cast<unsigned>(kCalls[i].number),
                              static_cast<unsigned char>(kNumCalls - i),
                              0);
  }
  program[kNumCalls + 1] = BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
  program[kNumCalls + 2] = BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_USER_NOTIF);
  const sock_fprog filter{kNumCalls + 3, program};
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return -1;
  return static_cast<int>(syscall(SYS_seccomp,
                                  SECCOMP_SET_MODE_FILTER,
                                  SECCOMP_FILTER_FLAG_NEW_LISTENER,
                                  &filter));
}

int TakeDescriptor(pid_t process, int file) {
  const int handle = static_cast<int>(syscall(SYS_pidfd_open, process, 0));
  if (handle < 0) return -1;
  const int taken = static_cast<int>(syscall(SYS_pidfd_getfd, handle, file, 0));
  close(handle);
  return taken;
}

FileCalls::FileCalls(int listener,
                     const std::string& folder,
                     const Fault& fault)
    : listener_(listener),
      folder_(std::filesystem::canonical(folder).string() + "/"),
      fault_(fault) {}

FileCalls::~FileCalls() { close(listener_); }

void FileCalls::Serve(int milliseconds) {
  pollfd wait{listener_, POLLIN, 0};
  poll(&wait, 1, milliseconds);
  if ((wait.revents & POLLIN) == 0) {
    has_ended_ = (wait.revents & POLLHUP) != 0;
    return;
  }
  seccomp_notif call{};
  if (ioctl(listener_, SECCOMP_IOCTL_NOTIF_RECV, &call) != 0) return;
  seccomp_notif_resp answer{};
  answer.id = call.id;
  answer.flags = SECCOMP_USER_NOTIF_FLAG_CONTINUE;
  const std::string name = NameOf(call);
  if (!name.empty()) {
    names_.push_back(name);
    if (static_cast<int>(names_.size()) == fault_.call) {
      MakeFault(call, &answer);
    }
  }
  // Fails if the process was killed.
  ioctl(listener_, SECCOMP_IOCTL_NOTIF_SEND, &answer);
}

std::string FileCalls::NameOf(const seccomp_notif& call) const {
  for (const CallRow& row : kCalls) {
    if (row.number != call.data.nr) continue;
    const auto& arguments = call.data.args;
    // mpirun has files of its own in other folders.
    const bool is_at = std::string(row.name).find("at") != std::string::npos;
    const std::string path =
        row.subject == Subject::kFile
            ? ""
            : TextAt(static_cast<pid_t>(call.pid), arguments[is_at ? 1 : 0]);
    if (path[0] == '/' &&
        std::filesystem::path(path).lexically_normal().string().rfind(folder_,
                                                                      0) != 0)
      return "";
    bool is_change = true;
    if (row.subject == Subject::kFile) {
      is_change = IsFileBelow(folder_,
                              static_cast<pid_t>(call.pid),
                              static_cast<int>(arguments[0]));
    } else if (row.subject != Subject::kPath) {
      is_change = ChangesFiles(
          static_cast<long>(arguments[row.subject == Subject::kOpen ? 1 : 2]));
    }
    return is_change ? row.name : "";
  }
  return "";
}

void FileCalls::MakeFault(const seccomp_notif& call,
                          seccomp_notif_resp* answer) {
  had_fault_ = true;
  switch (fault_.kind) {
    case Fault::Kind::kNone:
      had_fault_ = false;
      break;
    case Fault::Kind::kKill:
      kill(static_cast<pid_t>(call.pid), SIGKILL);
      break;
    case Fault::Kind::kError:
      answer->flags = 0;
      answer->error = -fault_.error_number;
      break;
    case Fault::Kind::kShortWrite:
      had_fault_ = call.data.nr == SYS_write && WriteHalf(call, answer);
      break;
  }
}

bool FileCalls::WriteHalf(const seccomp_notif& call,
                          seccomp_notif_resp* answer) const {
  const auto thread = static_cast<pid_t>(call.pid);
  std::string bytes(call.data.args[2] / 2, '\0');
  if (bytes.empty()) return false;
  const int file = TakeDescriptor(ProcessOfThread(thread),
                                  static_cast<int>(call.data.args[0]));
  if (file < 0) return false;
  const iovec here{bytes.data(), bytes.size()};
  // The kernel's interface passes addresses as numbers.
  const iovec there{reinterpret_cast<void*>(call.data.args[1]),  // NOLINT
                    bytes.size()};
  const ssize_t read = process_vm_readv(thread, &here, 1, &there, 1, 0);
  const ssize_t written = read > 0 ? write(file, bytes.data(), read) : -1;
  close(file);
  if (written < 0) return false;
  answer->flags = 0;
  answer->val = written;
  return true;
}

}  // namespace invgrad
