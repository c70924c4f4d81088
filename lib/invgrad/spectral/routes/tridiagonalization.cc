#include "invgrad/spectral/routes/tridiagonalization.h"

#include "invgrad/spectral/routes/householder.h"

namespace invgrad {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

using Method = Tridiagonalization::Method;

// The size from which two stages are used. Times of one and two stages on one
// core of a shared Zen 4 with 1 MB of L2: 46 and 73 ms at m = 1024, 186 and 220
// ms at 1536, 499 and 474 ms at 2048, 6.9 and 3.2 s at 4096.
constexpr int kCrossover = 1800;

Method Choose(Method method, Eigen::Index m) {
  if (method != Method::kAuto) return method;
  return m < kCrossover ? Method::kOneStage : Method::kTwoStage;
}

}  // namespace

void Tridiagonalization::Compute(MatrixXd* K, Method method) {
  K_ = K;
  method_ = Choose(method, K->rows());
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

int64_t Tridiagonalization::Bytes(int m, Method method) {
  const int64_t vectors = 3 * static_cast<int64_t>(sizeof(double)) * m;
  if (Choose(method, m) == Method::kOneStage) {
    return vectors + OneStageReduction::Bytes(m);
  }
  return vectors + BandReduction::Bytes(m, BulgeChase::kBandwidth) +
         BulgeChase::Bytes(m);
}

}  // namespace invgrad
