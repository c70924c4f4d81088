// The batches that bench_step takes its steps at: the four published sizes and
// a million weights.
#ifndef INVGRAD_BIN_SUPPORT_STEP_CASE_H_
#define INVGRAD_BIN_SUPPORT_STEP_CASE_H_

#include <memory>
#include <vector>

#include "Eigen/Core"
#include "invgrad/chain/model.h"
#include "invgrad/core/linearization.h"
#include "invgrad/spectral/spectral_filter.h"
#include "problems/problem.h"

namespace invgrad {

struct StepCaseRow {
  const char* name;
  const char* problem;
  double truncation;            // the published one
  std::vector<int> widths;      // of another network than the problem's
  bool full_svd_is_slow;        // a minute or more
  bool full_svd_is_impossible;  // J alone would take 33 GB
};

const std::vector<StepCaseRow>& StepCaseRows();

// A batch of a problem, linearized.
struct StepCase {
  const StepCaseRow* row;
  SpectralFilter filter;
  LearningProblem problem;
  std::shared_ptr<const Model> model;
  DataSet batch;
  Eigen::VectorXd weights;
  Linearization at_weights;

  // truncation = 0: the published one.
  StepCase(const StepCaseRow& case_row, double truncation);

  void Linearize(Linearization* at) const;
  const JacobianOperator& J() const { return *at_weights.jacobian; }
  const Eigen::VectorXd& g() const { return at_weights.loss_gradient; }

  // The operations of the Gram matrix and its reduction:
  // m^2 sum(widths) + 4/3 m^3.
  double LimitFlops() const;
};

}  // namespace invgrad

#endif  // INVGRAD_BIN_SUPPORT_STEP_CASE_H_
