#include "invgrad/internal/blas.h"

#include <cblas.h>

#include <algorithm>

#include "invgrad/core/blas_kernels.h"
#include "invgrad/core/openblas.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

CBLAS_TRANSPOSE ToCblas(Op op) {
  return op == Op::kNone ? CblasNoTrans : CblasTrans;
}

// BLAS requires a leading dimension of at least one, also for an empty matrix.
template <typename Matrix>
int LeadingDimension(const Matrix& A) {
  return std::max<int>(
      {1, static_cast<int>(A.rows()), static_cast<int>(A.outerStride())});
}

}  // namespace

void Gemm(Op op_A,
          Op op_B,
          double alpha,
          const Eigen::Ref<const Eigen::MatrixXd>& A,
          const Eigen::Ref<const Eigen::MatrixXd>& B,
          double beta,
          Eigen::Ref<Eigen::MatrixXd> C) {
  const int m = static_cast<int>(op_A == Op::kNone ? A.rows() : A.cols());
  const int k = static_cast<int>(op_A == Op::kNone ? A.cols() : A.rows());
  const int n = static_cast<int>(op_B == Op::kNone ? B.cols() : B.rows());
  CHECK_EQ(k, op_B == Op::kNone ? B.rows() : B.cols());
  CHECK_EQ(C.rows(), m);
  CHECK_EQ(C.cols(), n);
  WarnOnceOfOldBlasKernels();
  cblas_dgemm(CblasColMajor,
              ToCblas(op_A),
              ToCblas(op_B),
              m,
              n,
              k,
              alpha,
              A.data(),
              LeadingDimension(A),
              B.data(),
              LeadingDimension(B),
              beta,
              C.data(),
              LeadingDimension(C));
}

void Syrk(Op op_A,
          double alpha,
          const Eigen::Ref<const Eigen::MatrixXd>& A,
          double beta,
          Eigen::Ref<Eigen::MatrixXd> C) {
  const int m = static_cast<int>(op_A == Op::kNone ? A.rows() : A.cols());
  const int k = static_cast<int>(op_A == Op::kNone ? A.cols() : A.rows());
  CHECK_EQ(C.rows(), m);
  CHECK_EQ(C.cols(), m);
  WarnOnceOfOldBlasKernels();
  cblas_dsyrk(CblasColMajor,
              CblasLower,
              ToCblas(op_A),
              m,
              k,
              alpha,
              A.data(),
              LeadingDimension(A),
              beta,
              C.data(),
              LeadingDimension(C));
}

void Gemv(Op op_A,
          double alpha,
          const Eigen::Ref<const Eigen::MatrixXd>& A,
          const Eigen::Ref<const Eigen::VectorXd>& x,
          double beta,
          Eigen::Ref<Eigen::VectorXd> y) {
  CHECK_EQ(x.size(), op_A == Op::kNone ? A.cols() : A.rows());
  CHECK_EQ(y.size(), op_A == Op::kNone ? A.rows() : A.cols());
  CHECK_NE(x.data(), y.data()) << "A product cannot be computed in place.";
  // BLAS leaves y untouched where A has no rows or columns.
  if (A.size() == 0) {
    if (beta == 0.0) {
      y.setZero();
    } else {
      y *= beta;
    }
    return;
  }
  WarnOnceOfOldBlasKernels();
  cblas_dgemv(CblasColMajor,
              ToCblas(op_A),
              static_cast<int>(A.rows()),
              static_cast<int>(A.cols()),
              alpha,
              A.data(),
              LeadingDimension(A),
              x.data(),
              1,
              beta,
              y.data(),
              1);
}

std::string BlasName() {
  return openblas_get_config ? openblas_get_config() : "BLAS";
}

}  // namespace invgrad
