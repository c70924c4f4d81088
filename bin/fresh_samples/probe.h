// Predicts what a step does for samples that it is not computed from, and takes
// it to see.
//
//   step = -eta J^T psi(G) g,   psi(l) = (l + lambda)^-p,   p = (1 + kappa) / 2
//
//   predicted = (eta g.c - eta^2/2 c.H_L c) / L        by leave_one_out.h
//   linear    = -(g'.t + 1/2 t.H_L' t) / L'(theta),   t = J' step
//   measured  = 1 - L'(theta + step) / L'(theta)
//
// L is the loss of the batch that the step is computed from, L', g', J' and H_L'
// are those of the next batches. Chance keeps `linear` from `predicted`, and the
// curvature of the model keeps `measured` from `linear`. For least squares and
// eta = g.c / c.H_L c, `predicted` is LeaveOneOutScore::RelativeDecrease.
#ifndef BIN_FRESH_SAMPLES_PROBE_H_
#define BIN_FRESH_SAMPLES_PROBE_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/chain/data_source.h"
#include "invgrad/core/linearization.h"
#include "invgrad/spectral/leave_one_out.h"
#include "invgrad/spectral/spectral_step.h"
#include "problems/problem.h"

namespace invgrad {

struct FreshDecrease {
  double step_size = 0.0;  // eta
  double predicted = 0.0;
  double linear = 0.0;
  // NaN if the loss after the step is not finite.
  double measured = 0.0;
  double measured_test = 0.0;  // on the test data; NaN if there are none
};

class FreshProbe {
 public:
  // The batches are those of a training run with this seed, whose batches it
  // makes by batches(). The problem must outlive the probe.
  FreshProbe(const LearningProblem& problem,
             int batch_size,
             int num_fresh_batches,
             bool shuffles,
             int seed);

  // Whether there are so many batches; *error has the number.
  bool IsValid(std::string* error) const;

  int batch_size() const { return batch_size_; }
  std::shared_ptr<const DataSource> batches() const { return batches_; }

  // Linearizes at the weights, for the batch of step k = 0, 1, ... Returns
  // false, with *error, if a loss or the linearization is not finite, or if
  // leaving out samples fails.
  bool Begin(long step, const Eigen::VectorXd& weights, std::string* error);

  // The scores of the filters. A filter's noise is judged as damping, too: by the
  // value where half of a coefficient is noise.
  bool Score(std::vector<SpectralFilter> filters,
             std::vector<LeaveOneOutSummary>* summaries,
             std::string* error) const;

  // The step of the damped power that was judged in place of the filter, with
  // `step_size`; the weights of the run do not change.
  bool Measure(const SpectralFilter& filter,
               const LeaveOneOutSummary& summary,
               double step_size,
               FreshDecrease* decrease,
               std::string* error);

 private:
  double FreshLoss(const Eigen::VectorXd& weights) const;
  // Of the linear model of the next batches.
  double LinearDecrease(const Eigen::VectorXd& step) const;
  double TestLoss(const Eigen::VectorXd& weights) const;

  const LearningProblem& problem_;
  const int batch_size_;
  const int num_fresh_batches_;
  std::shared_ptr<const DataSource> batches_;

  // Since Begin.
  Eigen::VectorXd weights_;
  Linearization at_weights_;
  LeaveOneOut leave_one_out_;
  std::vector<DataSet> fresh_;
  std::vector<Linearization> fresh_at_weights_;
  double fresh_loss_ = 0.0;
  double test_loss_ = 0.0;
  SpectralWorkspace workspace_;
};

}  // namespace invgrad

#endif  // BIN_FRESH_SAMPLES_PROBE_H_
