// The system calls by which a program changes files (write, fsync, rename,
// ...), counted, and one of them with a fault.
//
// The kernel reports each call before it is made (SECCOMP_RET_USER_NOTIF, Linux
// 5.5), whatever library makes it, also from the program's own children, and
// waits for the parent's answer.
//
//   in the child, before exec:   const int listener = InstallFileCallFilter();
//   in the parent:               FileCalls calls(TakeDescriptor(child, listener),
//                                                folder, fault);
//                                while (!calls.has_ended()) calls.Serve(10);
#ifndef INVGRAD_TESTS_ATTACK_FILE_CALLS_H_
#define INVGRAD_TESTS_ATTACK_FILE_CALLS_H_

#include <sys/types.h>

#include <string>
#include <vector>

struct seccomp_notif;
struct seccomp_notif_resp;

namespace invgrad {

struct Fault {
  enum class Kind {
    kNone,        // only counts
    kKill,        // SIGKILL before the call
    kError,       // the call is not made and returns error_number
    kShortWrite,  // half of the bytes are written; other calls are made
  };
  Kind kind = Kind::kNone;
  int call = 0;          // which one, counted from 1
  int error_number = 0;  // ENOSPC, EINTR, ...
};

// Whether the kernel reports calls and permits it.
bool CanReportFileCalls();

// Returns a descriptor, or -1.
int InstallFileCallFilter();

// The descriptor `file` of the process in this process; -1 on failure.
int TakeDescriptor(pid_t process, int file);

class FileCalls {
 public:
  // Closes `listener`. Counts calls on files below `folder` alone.
  FileCalls(int listener, const std::string& folder, const Fault& fault);
  ~FileCalls();
  FileCalls(const FileCalls&) = delete;
  FileCalls& operator=(const FileCalls&) = delete;

  // Answers one call, or waits for one for so long.
  void Serve(int milliseconds);

  // True after all processes with the filter have ended.
  bool has_ended() const { return has_ended_; }
  const std::vector<std::string>& names() const { return names_; }
  bool had_fault() const { return had_fault_; }

 private:
  // The name of the call, if it changes a file; or empty.
  std::string NameOf(const seccomp_notif& call) const;
  void MakeFault(const seccomp_notif& call, seccomp_notif_resp* answer);
  bool WriteHalf(const seccomp_notif& call, seccomp_notif_resp* answer) const;

  const int listener_;
  const std::string folder_;
  const Fault fault_;
  std::vector<std::string> names_;
  bool had_fault_ = false;
  bool has_ended_ = false;
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_ATTACK_FILE_CALLS_H_
