#include "invgrad/train/recorder.h"

#include "invgrad/train/evaluation.h"

namespace invgrad {
namespace {

// Empty if no sample was inverted.
void FillCounts(const PullBackCounts& counts, HistoryRow* row) {
  if (counts.of(PullBackSource::kDerivative) > 0) return;
  const auto count = [&](PullBackSource source) {
    return static_cast<double>(counts.of(source));
  };
  row->by_inverse = count(PullBackSource::kInverse);
  row->by_numerical_inverse = count(PullBackSource::kNumericalInverse);
  row->by_inverse_gradient = count(PullBackSource::kInverseGradient);
  row->by_gradient = count(PullBackSource::kGradient);
  row->not_moved = count(PullBackSource::kNone);
}

}  // namespace

void Recorder::Record(const Eigen::VectorXd& weights,
                      const PullBackCounts* counts,
                      HistoryRow row) {
  if (test_.num_samples() > 0) row.test_loss = MeanLoss(model_, weights, test_);
  if (metric_) row.metric = metric_(weights);
  if (counts != nullptr) FillCounts(*counts, &row);
  history_.push_back(row);
  if (watched_loss() < best_loss_) {
    BeginPhase();
  } else {
    ++rows_since_best_;
  }
}

void Recorder::BeginPhase() {
  best_loss_ = watched_loss();
  rows_since_best_ = 0;
}

double Recorder::watched_loss() const {
  const HistoryRow& last = history_.back();
  return test_.num_samples() > 0 ? last.test_loss : last.train_loss;
}

void Recorder::VisitState(StateArchive* archive) {
  archive->Visit("best_loss", &best_loss_);
  archive->Visit("rows_since_best", &rows_since_best_);
  Eigen::VectorXd rows = PackHistory(history_);
  archive->Visit("history", &rows);
  archive->Require(UnpackHistory(rows, &history_), "history");
}

}  // namespace invgrad
