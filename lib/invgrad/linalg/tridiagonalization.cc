#include "invgrad/linalg/tridiagonalization.h"

#include <lapacke.h>

#include <algorithm>

#include "glog/logging.h"
#include "invgrad/linalg/householder.h"

namespace invgrad {

using Eigen::MatrixXd;
using Eigen::VectorXd;

void Tridiagonalization::Compute(MatrixXd* K, Method method) {
  K_ = K;
  method_ = method == Method::kAuto ? Method::kOneStage : method;
  if (method_ == Method::kOneStage) {
    one_stage_.Compute(K, &diagonal_, &off_diagonal_, &tau_);
  } else {
    band_reduction_.Compute(BulgeChase::kBandwidth, K, &tau_);
    bulge_chase_.Compute(*K, &diagonal_, &off_diagonal_);
  }
}

void Tridiagonalization::ApplyQTranspose(VectorXd* x) const {
  if (method_ == Method::kOneStage) {
    ApplyReflectors(*K_, 1, tau_, true, x);
  } else {
    ApplyReflectors(*K_, BulgeChase::kBandwidth, tau_, true, x);
    bulge_chase_.ApplyQ(true, x);
  }
}

void Tridiagonalization::ApplyQ(VectorXd* x) const {
  if (method_ == Method::kOneStage) {
    ApplyReflectors(*K_, 1, tau_, false, x);
  } else {
    bulge_chase_.ApplyQ(false, x);
    ApplyReflectors(*K_, BulgeChase::kBandwidth, tau_, false, x);
  }
}

void Tridiagonalization::ApplyQ(MatrixXd* X) const {
  // The width of LAPACK's blocks, and the room it takes for one.
  constexpr int kBlock = 64;
  const int m = static_cast<int>(X->rows());
  const int k = static_cast<int>(X->cols());
  CHECK_EQ(m, diagonal_.size());
  if (m < 2 || k == 0) return;
  VectorXd work(kBlock * k + (kBlock + 1) * kBlock);
  const int info = LAPACKE_dormtr_work(LAPACK_COL_MAJOR,
                                       'L',
                                       'L',
                                       'N',
                                       m,
                                       k,
                                       K_->data(),
                                       m,
                                       tau_.data(),
                                       X->data(),
                                       m,
                                       work.data(),
                                       static_cast<int>(work.size()));
  CHECK_EQ(info, 0);
}

int64_t Tridiagonalization::Bytes(int m, Method /*method*/) {
  return OneStageReduction::Bytes(m) +
         3 * static_cast<int64_t>(sizeof(double)) * m;
}

}  // namespace invgrad
