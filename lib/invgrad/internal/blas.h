// The few BLAS calls of the library, in Eigen's types.
//
//   C = alpha op(A) op(B) + beta C,   C = alpha op(A) op(A)^T + beta C,
//   y = alpha op(A) x + beta y
//
// Without -march=native, Eigen's own products reach a third of the speed of
// OpenBLAS, which chooses its kernels at run time.
//
// Shapes:  op(A): m x k;  op(B): k x n;  C: m x n (CHECKed). All column-major
//          with unit inner stride; blocks of larger matrices are fine.
// Cost:    2 m n k.
#ifndef INVGRAD_INTERNAL_BLAS_H_
#define INVGRAD_INTERNAL_BLAS_H_

#include <string>

#include "Eigen/Core"

namespace invgrad {

enum class Op { kNone, kTranspose };

// C = alpha op(A) op(B) + beta C. With beta = 0, C may hold anything.
void Gemm(Op op_A,
          Op op_B,
          double alpha,
          const Eigen::Ref<const Eigen::MatrixXd>& A,
          const Eigen::Ref<const Eigen::MatrixXd>& B,
          double beta,
          Eigen::Ref<Eigen::MatrixXd> C);

// C = alpha op(A) op(A)^T + beta C: the lower triangle only; the strictly upper
// triangle does not change.
void Syrk(Op op_A,
          double alpha,
          const Eigen::Ref<const Eigen::MatrixXd>& A,
          double beta,
          Eigen::Ref<Eigen::MatrixXd> C);

// y = alpha op(A) x + beta y. With beta = 0, y may hold anything.
void Gemv(Op op_A,
          double alpha,
          const Eigen::Ref<const Eigen::MatrixXd>& A,
          const Eigen::Ref<const Eigen::VectorXd>& x,
          double beta,
          Eigen::Ref<Eigen::VectorXd> y);

// The name and version of the loaded BLAS, and the kernels that it chose; "BLAS"
// if it is not OpenBLAS.
std::string BlasName();

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_BLAS_H_
