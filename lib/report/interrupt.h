// Lets a long run end cleanly on Ctrl-C.
//
//   Interrupt interrupt;
//   while (!Interrupt::IsRequested() && ...) { one step }
//   // write the results so far
//
// The first SIGINT or SIGTERM only sets a flag; the next one ends the process
// as usual. A signal that was ignored before (nohup, a background job) is still
// ignored. The destructor restores the previous handlers.
//
// Fails:   CHECKs that there is only one Interrupt at a time.
#ifndef REPORT_INTERRUPT_H_
#define REPORT_INTERRUPT_H_

namespace invgrad {

class Interrupt {
 public:
  using Handler = void (*)(int);

  Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  ~Interrupt();

  // True after a signal since the last Interrupt was constructed, also after
  // its destruction. Thread-safe.
  static bool IsRequested();

 private:
  Handler before_int_;
  Handler before_term_;
};

}  // namespace invgrad

#endif  // REPORT_INTERRUPT_H_
