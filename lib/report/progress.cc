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
          options.is_terminal.value_or(isatty(fileno(options.out)) == 1)) {
  if (!options_.clock) options_.clock = SteadySeconds;
}

void Progress::Update(const ProgressState& state) {
  const double wait = is_terminal_ ? 0.1 : 10.0;  // [s]
  const double now = options_.clock();
  if (!is_begun_) {
    is_begun_ = true;
    first_time_ = now;
    first_ = state;
    // On a terminal the first update is written at once.
    last_written_ = is_terminal_ ? now - wait : now;
  }
  if (now - last_written_ < wait) return;
  last_written_ = now;
  std::string line = Line(state, now);
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
  if (width_shown_ > 0) {
    std::fprintf(options_.out, "\r%*s\r", static_cast<int>(width_shown_), "");
    std::fflush(options_.out);
  }
  width_shown_ = 0;
  is_begun_ = false;
}

std::string Progress::Line(const ProgressState& state, double now) const {
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
  if (elapsed > 0.0 && state.step > first_.step) {
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
