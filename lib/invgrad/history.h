// The history of a run: one row per evaluation.
//
//   step,epoch,seconds,batch_loss,train_loss,test_loss,step_norm,metric,...
//   0,0,0,,0.25,0.26,,,,,,,
//   16,0.5,0.021,0.24,,,1.5e-3,,,,,,
//
// The next columns are by_inverse, by_numerical_inverse, by_inverse_gradient,
// by_gradient and not_moved: for methods that invert the simulator, the number
// of samples since the first step by the source of their d_x
// (simulator_pull_back.h).
//
// CSV with this header line; numbers with the fewest digits that read back as
// the same value. An unknown value is an empty field (NaN in memory); an
// overflowed loss is "inf". Written atomically (atomic_file.h).
//
// Fails:   returns false with a message that names the file and, for reading,
//          the line; *history is then unchanged.
#ifndef INVGRAD_HISTORY_H_
#define INVGRAD_HISTORY_H_

#include <limits>
#include <string>
#include <vector>

namespace invgrad {

struct HistoryRow {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  long step = 0;
  double epoch = 0.0;
  double seconds = 0.0;  // of training; evaluation is not counted
  double batch_loss = kNone;
  double train_loss = kNone;
  double test_loss = kNone;
  double step_norm = kNone;
  double metric = kNone;  // TrainOptions::metric
  double by_inverse = kNone;
  double by_numerical_inverse = kNone;
  double by_inverse_gradient = kNone;
  double by_gradient = kNone;
  double not_moved = kNone;
};

// All columns but the step, in the order of the file.
struct HistoryColumn {
  const char* name;
  double HistoryRow::*value;
};
inline constexpr HistoryColumn kHistoryColumns[] = {
    {"epoch", &HistoryRow::epoch},
    {"seconds", &HistoryRow::seconds},
    {"batch_loss", &HistoryRow::batch_loss},
    {"train_loss", &HistoryRow::train_loss},
    {"test_loss", &HistoryRow::test_loss},
    {"step_norm", &HistoryRow::step_norm},
    {"metric", &HistoryRow::metric},
    {"by_inverse", &HistoryRow::by_inverse},
    {"by_numerical_inverse", &HistoryRow::by_numerical_inverse},
    {"by_inverse_gradient", &HistoryRow::by_inverse_gradient},
    {"by_gradient", &HistoryRow::by_gradient},
    {"not_moved", &HistoryRow::not_moved}};

using History = std::vector<HistoryRow>;

bool WriteHistory(const std::string& path,
                  const History& history,
                  std::string* error);
bool ReadHistory(const std::string& path, History* history, std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_HISTORY_H_
