#include "report/interrupt.h"

#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <string_view>

#include "glog/logging.h"

namespace invgrad {
namespace {

constexpr int kSignals[] = {SIGINT, SIGTERM, SIGHUP};

std::atomic<int> first_signal{0};
std::atomic<pid_t> owner{0};  // the process with an Interrupt; 0: none
std::atomic<bool> prints{true};
static_assert(std::atomic<int>::is_always_lock_free,
              "a signal handler may only touch lock-free atomics");

// Sets a handler, unless the signal is ignored; returns the previous handler.
// (glibc restarts interrupted writes to files.)
Interrupt::Handler Install(int signal_number, Interrupt::Handler handler) {
  const Interrupt::Handler before = std::signal(signal_number, handler);
  if (before == SIG_IGN) std::signal(signal_number, SIG_IGN);
  return before;
}

extern "C" void HandleInterrupt(int signal_number) {
  const int error_number = errno;
  // From now on each of the signals ends the process.
  for (const int each : kSignals) Install(each, SIG_DFL);
  first_signal = signal_number;
  constexpr std::string_view kMessage =
      "\nending after the current step; a second signal ends at once, without "
      "tables\n";
  if (prints && owner == getpid() &&
      write(STDERR_FILENO, kMessage.data(), kMessage.size()) < 0) {
    // Nobody reads it.
  }
  errno = error_number;
}

}  // namespace

Interrupt::Interrupt(bool is_silent) {
  CHECK_EQ(owner.exchange(getpid()), 0) << "there is an Interrupt already";
  first_signal = 0;
  prints = !is_silent;
  for (size_t i = 0; i < before_.size(); ++i) {
    before_[i] = Install(kSignals[i], HandleInterrupt);
  }
}

Interrupt::~Interrupt() {
  for (size_t i = 0; i < before_.size(); ++i) {
    std::signal(kSignals[i], before_[i]);
  }
  owner = 0;
}

int Interrupt::Signal() { return first_signal; }

}  // namespace invgrad
