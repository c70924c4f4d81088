#include "report/interrupt.h"

#include <atomic>

#include "glog/logging.h"

namespace invgrad {
namespace {

std::atomic<bool> is_requested{false};
std::atomic<bool> exists{false};
static_assert(std::atomic<bool>::is_always_lock_free,
              "a signal handler may only touch lock-free atomics");

extern "C" void HandleInterrupt(int) {
  is_requested = true;
  // From now on each of the signals ends the process, unless it is ignored.
  for (const int signal_number : {SIGINT, SIGTERM}) {
    struct sigaction action;
    if (sigaction(signal_number, nullptr, &action) == 0 &&
        action.sa_handler == HandleInterrupt) {
      action.sa_handler = SIG_DFL;
      sigaction(signal_number, &action, nullptr);
    }
  }
}

void Install(int signal_number, struct sigaction* before) {
  struct sigaction action {};
  action.sa_handler = HandleInterrupt;
  // Without SA_RESTART a write to a file may fail with EINTR.
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  CHECK_EQ(sigaction(signal_number, nullptr, before), 0);
  if (before->sa_handler != SIG_IGN) {
    CHECK_EQ(sigaction(signal_number, &action, nullptr), 0);
  }
}

}  // namespace

Interrupt::Interrupt() {
  CHECK(!exists.exchange(true)) << "there is an Interrupt already";
  is_requested = false;
  Install(SIGINT, &before_int_);
  Install(SIGTERM, &before_term_);
}

Interrupt::~Interrupt() {
  sigaction(SIGINT, &before_int_, nullptr);
  sigaction(SIGTERM, &before_term_, nullptr);
  exists = false;
}

bool Interrupt::IsRequested() { return is_requested; }

}  // namespace invgrad
