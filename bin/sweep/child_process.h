// A job in a process of its own (fork), so that a crash affects only the job.
//
// The process ends with its parent, at once. While an Interrupt
// (report/interrupt.h) exists, only the parent receives Ctrl-C, and Stop sends a
// signal to the job, which should then end early.
//
// Fails:   the caller must have no threads that hold locks, as always with fork;
//          a job must not call MPI.
#ifndef BIN_SWEEP_CHILD_PROCESS_H_
#define BIN_SWEEP_CHILD_PROCESS_H_

#include <sys/types.h>

#include <functional>
#include <string>

namespace invgrad {

class ChildProcess {
 public:
  ChildProcess() = default;
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;
  ~ChildProcess();  // kills the job

  // Calls job(&error) in a new process. Returns false, with *error, if there is
  // none. CHECKs that none is running.
  bool Start(const std::function<bool(std::string* error)>& job,
             std::string* error);

  bool is_running() const { return pid_ != 0; }

  // Whether the job has ended just now. *message: its error, or "ended by signal
  // 11 (Segmentation fault)"; empty if it returned true.
  bool HasEnded(std::string* message);

  // Sends SIGTERM, once, if the job is running.
  void Stop();

 private:
  pid_t pid_ = 0;  // 0: none
  int message_pipe_ = -1;
  bool is_stopped_ = false;
};

}  // namespace invgrad

#endif  // BIN_SWEEP_CHILD_PROCESS_H_
