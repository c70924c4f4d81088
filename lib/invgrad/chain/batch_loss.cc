#include "invgrad/chain/batch_loss.h"

#include <optional>
#include <utility>

#include "invgrad/chain/loss_on_curve.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::VectorXd;

BatchLoss::BatchLoss(const std::shared_ptr<const Loss>& loss,
                     const DataSet& batch,
                     double scale,
                     bool hessians)
    : loss_(loss),
      batch_(batch),
      scale_(scale),
      values_(VectorXd::Zero(batch.num_samples())),
      has_failed_(batch.num_samples(), 0),
      gradients_(loss->size(), batch.num_samples()) {
  if (!loss->forms_hessian() || loss->has_invariant()) {
    outputs_.resize(loss->size(), batch.num_samples());
  }
  if (!loss->forms_hessian()) return;
  if (hessians || !loss->SquaredNormFactor().has_value()) {
    hessians_.resize(loss->size(), loss->size() * batch.num_samples());
  }
}

bool BatchLoss::Add(int s, const VectorXd& y) {
  auto gradient = gradients_.col(s);
  double* const hessian = has_hessians() ? Hessian(s).data() : nullptr;
  if (!loss_->Evaluate(y.data(),
                       batch_.targets.col(s).data(),
                       &values_[s],
                       gradient.data(),
                       hessian)) {
    has_failed_[s] = 1;
    return false;
  }
  if (outputs_.size() > 0) outputs_.col(s) = y;
  gradient *= scale_;
  if (has_hessians()) Hessian(s) *= scale_;
  return true;
}

double BatchLoss::cost() const {
  double cost = 0.0;
  for (const double value : values_) cost += scale_ * value;
  return cost;
}

void BatchLoss::MoveTo(Linearization* linearization) {
  if (loss_->has_invariant()) {
    linearization->loss_on_curve =
        MakeLossOnCurve(loss_, outputs_, batch_.targets, scale_);
  }
  linearization->loss_hessian_times = TakeHessianTimes();
}

std::function<VectorXd(const VectorXd&)> BatchLoss::TakeHessianTimes() {
  if (const std::optional<double> factor = loss_->SquaredNormFactor()) {
    const double c = 2.0 * *factor * scale_;
    return [c](const VectorXd& v) -> VectorXd { return c * v; };
  }
  if (!loss_->forms_hessian()) return HessianProducts();
  return [blocks = std::move(hessians_)](const VectorXd& v) {
    CHECK_EQ(v.size(), blocks.cols());
    const Eigen::Index size = blocks.rows();
    VectorXd Hv(v.size());
    for (Eigen::Index row = 0; row < v.size(); row += size) {
      Hv.segment(row, size).noalias() =
          blocks.middleCols(row, size) * v.segment(row, size);
    }
    return Hv;
  };
}

std::function<VectorXd(const VectorXd&)> BatchLoss::HessianProducts() {
  return [loss = loss_,
          outputs = std::move(outputs_),
          targets = batch_.targets,
          scale = scale_](const VectorXd& v) {
    CHECK_EQ(v.size(), outputs.size());
    const Eigen::Index size = outputs.rows();
    VectorXd Hv(v.size());
    for (Eigen::Index s = 0; s < outputs.cols(); ++s) {
      Hv.segment(s * size, size) =
          scale * loss->HessianTimes(outputs.col(s).data(),
                                     targets.col(s).data(),
                                     v.segment(s * size, size));
    }
    return Hv;
  };
}

}  // namespace invgrad
