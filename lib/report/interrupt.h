// Lets a long run end cleanly on Ctrl-C.
//
//   Interrupt interrupt;
//   while (!Interrupt::IsRequested() && ...) { one step }
//   // write the results so far
//
// The first SIGINT, SIGTERM or SIGHUP sets a flag and prints on stderr that the
// run ends after the current step; the next one ends the process as usual. A
// signal that was ignored before (nohup, a background job) is still ignored.
// The destructor restores the previous handlers. Only the process that
// constructed the Interrupt prints, not its children.
//
// Fails:   CHECKs that there is only one Interrupt at a time.
#ifndef REPORT_INTERRUPT_H_
#define REPORT_INTERRUPT_H_

#include <array>

namespace invgrad {

class Interrupt {
 public:
  using Handler = void (*)(int);

  // is_silent: prints nothing, as on all ranks of MPI but the first.
  explicit Interrupt(bool is_silent = false);
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  ~Interrupt();

  // The first signal since the last Interrupt was constructed, also after its
  // destruction; 0: none. Thread-safe.
  static int Signal();
  static bool IsRequested() { return Signal() != 0; }

 private:
  std::array<Handler, 3> before_;
};

}  // namespace invgrad

#endif  // REPORT_INTERRUPT_H_
