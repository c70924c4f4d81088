#include "invgrad/spectral/routes/householder.h"

#include <algorithm>

#include "glog/logging.h"

namespace invgrad {
namespace {

INVGRAD_INLINE inline void ApplyInTurn(int m,
                                       const double* A,
                                       int offset,
                                       int num_reflectors,
                                       const double* tau,
                                       bool transpose,
                                       double* x) {
  for (int k = 0; k < num_reflectors; ++k) {
    const int j = transpose ? k : num_reflectors - 1 - k;
    const int first = j + offset;
    const double* u = A + static_cast<Eigen::Index>(j) * m + first;
    ApplyReflector(m - first, u, tau[j], x + first);
  }
}

}  // namespace

void ApplyReflectors(const Eigen::MatrixXd& A,
                     int offset,
                     const Eigen::VectorXd& tau,
                     bool transpose,
                     Eigen::VectorXd* x) {
  CHECK_EQ(x->size(), A.rows());
  CHECK_LE(tau.size(), std::max<Eigen::Index>(0, A.rows() - offset));
  simd::Run([&]() INVGRAD_INLINE {
    ApplyInTurn(static_cast<int>(A.rows()),
                A.data(),
                offset,
                static_cast<int>(tau.size()),
                tau.data(),
                transpose,
                x->data());
  });
}

}  // namespace invgrad
