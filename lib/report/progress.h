// One line with the progress of a run.
//
//   half_inverse  step 1200  epoch 4.2  loss 3.1e-07  920 steps/s
//       elapsed 1.3 s  left 4.5 s                     (on the same line)
//
// On a terminal the line is rewritten in place, cut to the terminal's width;
// elsewhere (a log file) a whole line is written every 10 seconds. Speed and
// remaining time are measured from the first update with a step on, so they are
// correct for a resumed run.
//
// A step that takes longer than five seconds is shown while it lasts, by a
// thread that wakes once a second and touches nothing else:
//
//   half_inverse  step 3  loss 0.12  elapsed 21.0 s  this step 9.0 s
//
// Cost:    most updates only read the clock.
#ifndef REPORT_PROGRESS_H_
#define REPORT_PROGRESS_H_

#include <condition_variable>
#include <cstdio>
#include <functional>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

namespace invgrad {

// "0.250 s", "12.3 s", "3 min 05 s", "2 h 03 min", "4 d 07 h"; "?" for values
// that are no duration.
std::string FormatDuration(double seconds);

struct ProgressState {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  static constexpr long kNoStep = -1;  // not shown: before the first step
  std::string label;
  long step = 0;
  double epoch = kUnknown;
  double batch_size = kUnknown;
  double loss = kUnknown;
  double fraction = kUnknown;  // of the budget, in [0, 1]
};

class Progress {
 public:
  struct Options {
    std::FILE* out = stderr;
    std::optional<bool> is_terminal;  // default: by isatty
    // Seconds since any fixed time; the steady clock if not given. With another
    // clock there is no thread: call Tick.
    std::function<double()> clock;
  };

  explicit Progress(const Options& options);
  Progress() : Progress(Options{}) {}
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  ~Progress() { Clear(); }

  // Writes the line if it is due. To be called before the first step and after
  // every step.
  void Update(const ProgressState& state);

  // Writes the line if the step takes long and the line is due. The thread
  // calls it.
  void Tick();

  // Removes the line from the terminal, so that other text can be written. The
  // next update begins a new run.
  void Clear();

 private:
  std::string Line(double now) const;
  // The line, with `more` at its end.
  void WriteIfDue(double now, double wait, const std::string& more);
  // Ticks until the run ends.
  void TickEverySecond();

  Options options_;
  bool is_terminal_;
  const bool has_thread_;

  std::mutex mutex_;  // of all that follows, but for the thread
  bool is_begun_ = false;
  double first_time_ = 0.0;
  ProgressState first_;
  double last_time_ = 0.0;  // of an update
  ProgressState last_;
  double last_written_ = 0.0;
  size_t width_shown_ = 0;  // width of the current text on the terminal
  std::condition_variable has_ended_;
  std::thread thread_;
};

}  // namespace invgrad

#endif  // REPORT_PROGRESS_H_
