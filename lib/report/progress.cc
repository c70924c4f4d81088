#include "report/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "fmt/core.h"
#include "glog/logging.h"
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

Progress::Progress(const Options& options)
    : options_(options),
      is_terminal_(
          options.is_terminal.value_or(isatty(fileno(options.out)) == 1)) {
  CHECK(options_.out != nullptr);
  if (!options_.clock) {
    options_.clock = SteadySeconds;
  }
}

void Progress::Update(const ProgressState& state) {
  const double now = options_.clock();
  if (!is_begun_) {
    is_begun_ = true;
    first_time_ = now;
    first_ = state;
    // On a terminal the first update is written at once.
    last_written_ = is_terminal_ ? now - options_.seconds_between_updates : now;
  }
  const double wait = is_terminal_ ? options_.seconds_between_updates
                                   : options_.seconds_between_lines;
  if (now - last_written_ < wait) {
    return;
  }
  last_written_ = now;
  std::string line = Line(state, now);
  if (is_terminal_) {
    // The last column stays empty, because writing to it makes some terminals
    // wrap.
    line = line.substr(0, NumColumns(options_.out) - 1);
    const int width = line.size();
    std::fprintf(options_.out,
                 "\r%s%*s",
                 line.c_str(),
                 std::max(width_shown_ - width, 0),
                 "");
    width_shown_ = width;
  } else {
    std::fprintf(options_.out, "%s\n", line.c_str());
  }
  std::fflush(options_.out);
}

void Progress::Clear() {
  if (width_shown_ > 0) {
    std::fprintf(options_.out, "\r%*s\r", width_shown_, "");
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
  if (!std::isnan(state.loss)) {
    line += "  loss " + FormatNumber(state.loss);
  }
  if (elapsed > 0.0 && state.step > first_.step) {
    constexpr int kDigits = 3;
    line += "  " + FormatNumber((state.step - first_.step) / elapsed, kDigits) +
            " steps/s";
  }
  line += "  elapsed " + FormatDuration(elapsed);
  const double done = state.fraction - first_.fraction;
  if (done > 0.0) {
    line +=
        "  left " +
        FormatDuration(elapsed * std::max(1.0 - state.fraction, 0.0) / done);
  }
  return line;
}

}  // namespace invgrad
