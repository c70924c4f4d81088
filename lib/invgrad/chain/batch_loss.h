// The loss of a batch with its derivatives in y, sample by sample. Threads may add
// different samples.
//
//   L = scale sum_s L(y_s, y*_s),   g_s = scale dL/dy_s,   H_L = diag(scale H_s)
//
// Shapes:  y_s, g_s: |y|;  H_s: |y| x |y|, formed only if asked for, or if the loss
//          is no squared norm and forms it.
#ifndef INVGRAD_CHAIN_BATCH_LOSS_H_
#define INVGRAD_CHAIN_BATCH_LOSS_H_

#include <functional>
#include <memory>
#include <vector>

#include "Eigen/Core"
#include "invgrad/data.h"
#include "invgrad/linearization.h"
#include "invgrad/loss.h"

namespace invgrad {

class BatchLoss {
 public:
  // Keeps the batch, which must outlive the object. hessians: whether to form
  // H_L also of a squared norm.
  BatchLoss(const std::shared_ptr<const Loss>& loss,
            const DataSet& batch,
            double scale,
            bool hessians);

  // Adds the loss of sample s. Returns false if it has no finite value.
  bool Add(int s, const Eigen::VectorXd& y);

  bool has_failed(int s) const { return has_failed_[s] != 0; }
  // The sum over the samples, in their order.
  double cost() const;
  const Eigen::MatrixXd& gradients() const { return gradients_; }
  // H_L of sample s.
  Eigen::Block<Eigen::MatrixXd, Eigen::Dynamic, Eigen::Dynamic, true> Hessian(
      int s) {
    return hessians_.middleCols(s * loss_->size(), loss_->size());
  }

  // The model of the loss in y. Moves the Hessians and the outputs.
  void MoveTo(Linearization* linearization);

 private:
  bool has_hessians() const { return hessians_.size() > 0; }

  // v -> H_L v.
  std::function<Eigen::VectorXd(const Eigen::VectorXd&)> TakeHessianTimes();
  std::function<Eigen::VectorXd(const Eigen::VectorXd&)> HessianProducts();

  const std::shared_ptr<const Loss> loss_;
  const DataSet& batch_;
  const double scale_;
  Eigen::VectorXd values_;
  std::vector<char> has_failed_;
  Eigen::MatrixXd gradients_;
  Eigen::MatrixXd hessians_;  // the blocks of H_L, side by side
  // y, if the loss has only products with H_L or has an invariant.
  Eigen::MatrixXd outputs_;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_BATCH_LOSS_H_
