#include "report/gnuplot.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <iterator>
#include <limits>
#include <set>
#include <system_error>

#include "fmt/ranges.h"
#include "report/interrupt.h"

namespace invgrad {
namespace {

// gnuplot treats values above 8.99e307 as undefined; this limit leaves space
// for margins.
constexpr double kLargest = 1e306;
constexpr double kSmallest = 1e-306;  // on a logarithmic axis

std::string TicksText(const Ticks& ticks) {
  // Shows only some of many labels.
  constexpr size_t kMaxLabels = 16;
  const size_t stride = (ticks.size() + kMaxLabels - 1) / kMaxLabels;
  std::string text;
  for (size_t i = 0; i < ticks.size(); i += stride) {
    text += fmt::format("{}{} {:.10g}",
                        i > 0 ? ", " : "",
                        QuoteForGnuplot(ticks[i].second),
                        ticks[i].first);
  }
  return "(" + text + ")";
}

}  // namespace

// Special characters of gnuplot's double quotes become octal numbers. (gnuplot
// 5.4 misreads a single-quoted string that begins with a quote.)
std::string QuoteForGnuplot(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (code < 0x20 || code == 0x7f) {
      quoted += ' ';
    } else if (std::string_view("\"'`\\@$").find(c) != std::string_view::npos) {
      quoted += fmt::format("\\{:03o}", code);
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

std::string RunGnuplot(const std::string& folder,
                       const std::string& script,
                       double max_seconds) {
  using Clock = std::chrono::steady_clock;
  const std::string path = "./" + script;
  const int signal_before = Interrupt::Signal();
  const auto cannot_run = [] {
    return "cannot run gnuplot: " + std::generic_category().message(errno);
  };
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return cannot_run();
  constexpr int kNotFound = 127, kNotStarted = 126;  // as of a shell
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child == 0) {
    // A group of its own: Ctrl-C goes to the parent, which ends this process.
    // (gnuplot itself goes on after Ctrl-C.)
    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    const int nothing = open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (getppid() == parent && chdir(folder.c_str()) == 0 &&
        dup2(nothing, STDIN_FILENO) >= 0 && dup2(ends[1], STDOUT_FILENO) >= 0 &&
        dup2(ends[1], STDERR_FILENO) >= 0) {
      // Without the settings of the user's ~/.gnuplot.
      execlp("gnuplot",
             "gnuplot",
             "--default-settings",
             path.c_str(),
             static_cast<char*>(nullptr));
      _exit(errno == ENOENT ? kNotFound : kNotStarted);
    }
    _exit(kNotStarted);
  }
  close(ends[1]);
  std::string output, problem;
  if (child < 0) problem = cannot_run();
  const Clock::time_point start = Clock::now();
  bool is_open = child >= 0;
  while (is_open && problem.empty()) {
    constexpr int kWaitInMilliseconds = 50;
    pollfd waiting = {ends[0], POLLIN, 0};
    if (poll(&waiting, 1, kWaitInMilliseconds) > 0) {
      char buffer[4096];
      const ssize_t count = read(ends[0], buffer, sizeof(buffer));
      is_open = count > 0;
      if (is_open) output.append(buffer, count);
    }
    const std::chrono::duration<double> seconds = Clock::now() - start;
    if (Interrupt::Signal() != signal_before) {
      problem = "gnuplot was ended by a signal to this program";
    } else if (seconds.count() > max_seconds) {
      problem = fmt::format("gnuplot took more than {:g} s and was ended",
                            max_seconds);
    }
  }
  close(ends[0]);
  if (child < 0) return problem;
  if (!problem.empty()) {
    setpgid(child, child);  // if the child has not done it yet
    kill(-child, SIGKILL);
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (!problem.empty()) return problem;
  if (WIFSIGNALED(status)) {
    return fmt::format("gnuplot was ended by signal {}", WTERMSIG(status));
  }
  if (WEXITSTATUS(status) == kNotFound) {
    return "gnuplot is not installed (apt install gnuplot-nox)";
  }
  return WEXITSTATUS(status) == 0 ? "" : "gnuplot failed: " + output;
}

bool CanDraw(double value, bool is_log) {
  return std::abs(value) <= kLargest && (!is_log || value >= kSmallest);
}

Axis FitAxis(bool is_log,
             const AxisRange& range,
             double margin,
             const std::vector<double>& values) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const double value : values) {
    if (!CanDraw(value, is_log)) continue;
    low = std::min(low, is_log ? std::log10(value) : value);
    high = std::max(high, is_log ? std::log10(value) : value);
  }
  if (low > high) low = high = 0.5;  // nothing to draw
  double pad = margin * (high - low);
  if (high - low <= 1e-12 * std::max(std::abs(low), std::abs(high))) {
    pad = is_log || std::abs(high) < 1e-100 ? 0.5 : 0.1 * std::abs(high);
  }
  const auto end = [is_log](double display) {
    return std::clamp(is_log ? std::pow(10.0, display) : display,
                      is_log ? kSmallest : -kLargest,
                      kLargest);
  };
  Axis axis{is_log, end(low - pad), end(high + pad)};
  if (range.low && CanDraw(*range.low, is_log)) axis.low = *range.low;
  if (range.high && CanDraw(*range.high, is_log)) axis.high = *range.high;
  constexpr double kMinRatio = 5.0;
  if (axis.high < kMinRatio * axis.low) axis.is_log = false;
  return axis;
}

std::string AxisCommands(const std::string& name,
                         const Axis& axis,
                         Ticks ticks) {
  // gnuplot labels only powers of ten, too few for less than two decades.
  const bool is_short = axis.high < 100.0 * axis.low;
  if (ticks.empty() && axis.is_log && is_short) {
    const double first = std::pow(10.0, std::floor(std::log10(axis.low)));
    for (const double factor : {1, 2, 5, 10, 20, 50, 100, 200, 500}) {
      const double tick = factor * first;
      if (tick < axis.low || tick > axis.high) continue;
      ticks.emplace_back(tick, fmt::format("{:.10g}", tick));
    }
  }
  return fmt::format(
      "{} logscale {}\nset {}range [{:.10g}:{:.10g}]\nset format {} '{}'\n"
      "set {}tics {}\n",
      axis.is_log ? "set" : "unset",
      name,
      name,
      axis.low,
      axis.high,
      name,
      axis.is_log && !is_short ? "10^{%T}" : "%h",
      name,
      ticks.empty() ? "auto" : TicksText(ticks));
}

int AppendSeries(const std::string& name,
                 const Series& series,
                 const Axis& x_axis,
                 const Axis& y_axis,
                 std::string* script) {
  *script += name + " << EOD\n";
  int num_points = 0;
  bool is_gap = true;  // no gap before the first point, and none doubled
  for (size_t i = 0; i < series.x.size(); ++i) {
    const bool is_drawn = CanDraw(series.x[i], x_axis.is_log) &&
                          CanDraw(series.y[i], y_axis.is_log);
    if (is_drawn) {
      *script += fmt::format("{:.10g} {:.10g}", series.x[i], series.y[i]);
      for (const auto* ends : {&series.y_low, &series.y_high}) {
        if (ends->empty()) continue;
        // Clips a band at the lower end of a logarithmic axis.
        const double end =
            y_axis.is_log ? std::max((*ends)[i], y_axis.low) : (*ends)[i];
        *script += fmt::format(" {:.10g}",
                               CanDraw(end, y_axis.is_log) ? end : series.y[i]);
      }
    }
    if (is_drawn || !is_gap) *script += '\n';
    is_gap = !is_drawn;
    num_points += is_drawn ? 1 : 0;
  }
  *script += "EOD\n";
  return num_points;
}

bool AppendContours(const std::string& name,
                    const ContourField& field,
                    std::string* script) {
  std::vector<double> z;
  std::copy_if(field.z.data(),
               field.z.data() + field.z.size(),
               std::back_inserter(z),
               [](double value) { return std::isfinite(value); });
  std::sort(z.begin(), z.end());
  std::set<double> levels;
  constexpr size_t kNumLevels = 14;
  for (size_t k = 1; k <= kNumLevels && z.size() > 1; ++k) {
    // Halfway to the next value: no line touches a point of the grid.
    const size_t i = (z.size() - 2) * k / (kNumLevels + 1);
    levels.insert(0.5 * (z[i] + z[i + 1]));
  }
  if (levels.empty() || field.x.size() < 2 || field.y.size() < 2) return false;
  *script += name + "_grid << EOD\n";
  for (size_t i = 0; i < field.y.size(); ++i) {
    for (size_t j = 0; j < field.x.size(); ++j) {
      *script += fmt::format(
          "{:.10g} {:.10g} {:.10g}\n", field.x[j], field.y[i], field.z(i, j));
    }
    *script += '\n';
  }
  *script += fmt::format(
      "EOD\nset cntrparam linear levels discrete {:.10g}\n"
      "set contour base\nunset surface\nset table {}\n"
      "splot {}_grid using 1:2:3\nunset table\nunset contour\nset surface\n",
      fmt::join(levels, ","),
      name,
      name);
  return true;
}

bool AppendCells(const std::string& name,
                 const HeatMap& map,
                 std::string* script) {
  std::string cells;
  for (Eigen::Index i = 0; i < map.z.rows(); ++i) {
    for (Eigen::Index j = 0; j < map.z.cols(); ++j) {
      if (!CanDraw(map.z(i, j), map.log_z)) continue;
      cells += fmt::format("{} {} {:.10g}\n", j, i, map.z(i, j));
    }
  }
  *script += fmt::format("{} << EOD\n{}EOD\n", name, cells);
  return !cells.empty();
}

}  // namespace invgrad
