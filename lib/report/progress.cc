#include "report/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>

#include "fmt/core.h"
#include "invgrad/io/format.h"

namespace invgrad {
namespace {

double SteadySeconds() {
  return std::chrono::duration<double>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

int NumColumns(std::FILE* out) {
  winsize size{};
  constexpr int kUsual = 80;
  return ioctl(fileno(out), TIOCGWINSZ, &size) == 0 && size.ws_col > 0
             ? size.ws_col
             : kUsual;
}

}  // namespace

std::string FormatDuration(double seconds) {
  constexpr double kLongest = 1e12;
  if (!(seconds >= 0.0 && seconds < kLongest)) return "?";
  // At these bounds the shorter form would round up to the next unit.
  if (seconds < 0.9995) return fmt::format("{:.3f} s", seconds);
  if (seconds < 59.95) return fmt::format("{:.1f} s", seconds);
  const auto in_units_of = [&](double unit) {
    return std::ldiv(std::lround(seconds / unit), unit < 3600.0 ? 60 : 24);
  };
  if (const auto [minutes, rest] = in_units_of(1.0); minutes < 60) {
    return fmt::format("{} min {:02} s", minutes, rest);
  }
  if (const auto [hours, rest] = in_units_of(60.0); hours < 24) {
    return fmt::format("{} h {:02} min", hours, rest);
  }
  const auto [days, rest] = in_units_of(3600.0);
  return fmt::format("{} d {:02} h", days, rest);
}

Progress::Progress(const Options& options)
    : options_(options),
      is_terminal_(
          options.is_terminal.value_or(isatty(fileno(options.out)) == 1)),
      has_thread_(!options.clock) {
  if (!options_.clock) options_.clock = SteadySeconds;
}

void Progress::Update(const ProgressState& state) {
  const double wait = is_terminal_ ? 0.1 : 10.0;  // [s]
  const std::lock_guard<std::mutex> lock(mutex_);
  const double now = options_.clock();
  const bool is_first = !is_begun_;
  const bool is_first_step = first_.step == ProgressState::kNoStep &&
                             state.step != ProgressState::kNoStep;
  if (is_first || is_first_step) {
    first_time_ = now;
    first_ = state;
  }
  if (is_first) {
    is_begun_ = true;
    // On a terminal the first update is written at once.
    last_written_ = is_terminal_ ? now - wait : now;
    if (has_thread_) thread_ = std::thread(&Progress::TickEverySecond, this);
  }
  last_ = state;
  last_time_ = now;
  WriteIfDue(now, wait, "");
}

void Progress::Tick() {
  constexpr double kLong = 5.0;                   // [s]
  const double wait = is_terminal_ ? 1.0 : 10.0;  // [s]
  const std::lock_guard<std::mutex> lock(mutex_);
  const double now = options_.clock();
  const double of_step = now - last_time_;
  if (!is_begun_ || of_step < kLong) return;
  WriteIfDue(now, wait, "  this step " + FormatDuration(of_step));
}

void Progress::TickEverySecond() {
  constexpr std::chrono::seconds kPause(1);
  std::unique_lock<std::mutex> lock(mutex_);
  while (!has_ended_.wait_for(lock, kPause, [this] { return !is_begun_; })) {
    lock.unlock();
    Tick();
    lock.lock();
  }
}

void Progress::WriteIfDue(double now, double wait, const std::string& more) {
  if (now - last_written_ < wait) return;
  last_written_ = now;
  std::string line = Line(now) + more;
  if (is_terminal_) {
    // The last column stays empty, because writing to it makes some terminals
    // wrap.
    line = line.substr(0, NumColumns(options_.out) - 1);
    const size_t width = line.size();
    line.resize(std::max(width_shown_, width), ' ');
    line = '\r' + line;
    width_shown_ = width;
  } else {
    line += '\n';
  }
  std::fputs(line.c_str(), options_.out);
  std::fflush(options_.out);
}

void Progress::Clear() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_begun_ = false;
  }
  has_ended_.notify_one();
  if (thread_.joinable()) thread_.join();
  if (width_shown_ > 0) {
    std::fprintf(options_.out, "\r%*s\r", static_cast<int>(width_shown_), "");
    std::fflush(options_.out);
  }
  width_shown_ = 0;
}

std::string Progress::Line(double now) const {
  const ProgressState& state = last_;
  const double elapsed = now - first_time_;
  std::string line = state.label;
  if (state.step != ProgressState::kNoStep) {
    line += fmt::format("  step {}", state.step);
  }
  if (!std::isnan(state.epoch)) {
    line += fmt::format("  epoch {:.1f}", state.epoch);
  }
  if (!std::isnan(state.batch_size)) {
    line += fmt::format("  batch {:.0f}", state.batch_size);
  }
  if (!std::isnan(state.loss)) line += "  loss " + FormatNumber(state.loss);
  if (elapsed > 0.0 && first_.step != ProgressState::kNoStep &&
      state.step > first_.step) {
    line +=
        fmt::format("  {:.3g} steps/s",
                    static_cast<double>(state.step - first_.step) / elapsed);
  }
  line += "  elapsed " + FormatDuration(elapsed);
  const double done = state.fraction - first_.fraction;
  if (done > 0.0) {
    const double left = std::max(1.0 - state.fraction, 0.0);
    line += "  left " + FormatDuration(elapsed * left / done);
  }
  return line;
}

}  // namespace invgrad
