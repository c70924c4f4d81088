// Evaluates the losses of a training run, records its history, and detects when
// the losses stop falling.
#ifndef INVGRAD_TRAIN_RECORDER_H_
#define INVGRAD_TRAIN_RECORDER_H_

#include <functional>
#include <limits>

#include "Eigen/Core"
#include "invgrad/chain/model.h"
#include "invgrad/inverse/pull_back_counts.h"
#include "invgrad/train/history.h"
#include "invgrad/train/state_archive.h"

namespace invgrad {

class Recorder {
 public:
  using Metric = std::function<double(const Eigen::VectorXd& weights)>;

  // Model and test data must outlive the recorder. `metric` may be null.
  Recorder(const Model* model, const DataSet* test, Metric metric)
      : model_(*model), test_(*test), metric_(std::move(metric)) {}

  const History& history() const { return history_; }
  void Clear() { history_.clear(); }

  // Adds a row with test loss, metric and counts (which may be null).
  void Record(const Eigen::VectorXd& weights,
              const PullBackCounts* counts,
              HistoryRow row);

  // Restarts the count of patience at the last row.
  void BeginPhase();
  // Rows since the lowest test loss, or train loss if there are no test data.
  int rows_since_best() const { return rows_since_best_; }

  void VisitState(StateArchive* archive);

 private:
  double watched_loss() const;

  const Model& model_;
  const DataSet& test_;
  const Metric metric_;
  History history_;
  double best_loss_ = std::numeric_limits<double>::infinity();
  int rows_since_best_ = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_RECORDER_H_
