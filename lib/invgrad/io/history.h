// What a run leaves behind: one row each time that it was looked at.
//
// CSV with a header line; numbers with 17 digits, so that reading it back gives
// the same values. A value that was not computed is an empty field (NaN in
// memory).
#ifndef INVGRAD_IO_HISTORY_H_
#define INVGRAD_IO_HISTORY_H_

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
};

using History = std::vector<HistoryRow>;

bool WriteHistory(const std::string& path,
                  const History& history,
                  std::string* error);
// *error names file and line.
bool ReadHistory(const std::string& path, History* history, std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_IO_HISTORY_H_
