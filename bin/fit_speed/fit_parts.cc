#include "bin/fit_speed/fit_parts.h"

#include <chrono>

namespace invgrad {

double Seconds(const std::function<void()>& work) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point start = Clock::now();
  work();
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace invgrad
