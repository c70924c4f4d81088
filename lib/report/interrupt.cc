#include "report/interrupt.h"

#include <atomic>
#include <csignal>

#include "glog/logging.h"

namespace invgrad {
namespace {

std::atomic<bool> is_requested{false};
std::atomic<bool> exists{false};
static_assert(std::atomic<bool>::is_always_lock_free,
              "a signal handler may only touch lock-free atomics");

// Sets a handler, unless the signal is ignored; returns the previous handler.
// (glibc restarts interrupted writes to files.)
Interrupt::Handler Install(int signal_number, Interrupt::Handler handler) {
  const Interrupt::Handler before = std::signal(signal_number, handler);
  if (before == SIG_IGN) std::signal(signal_number, SIG_IGN);
  return before;
}

extern "C" void HandleInterrupt(int) {
  is_requested = true;
  // From now on each of the signals ends the process.
  Install(SIGINT, SIG_DFL);
  Install(SIGTERM, SIG_DFL);
}

}  // namespace

Interrupt::Interrupt() {
  CHECK(!exists.exchange(true)) << "there is an Interrupt already";
  is_requested = false;
  before_int_ = Install(SIGINT, HandleInterrupt);
  before_term_ = Install(SIGTERM, HandleInterrupt);
}

Interrupt::~Interrupt() {
  std::signal(SIGINT, before_int_);
  std::signal(SIGTERM, before_term_);
  exists = false;
}

bool Interrupt::IsRequested() { return is_requested; }

}  // namespace invgrad
