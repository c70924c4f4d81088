// Eigen's decompositions and products of MatrixXd are compiled once, in
// eigen_templates.cc: each takes a compiler seconds.
//
// A part of the precompiled header: sources include Eigen's own headers.
#ifndef INVGRAD_CORE_EIGEN_TEMPLATES_H_
#define INVGRAD_CORE_EIGEN_TEMPLATES_H_

#include "Eigen/Core"
#include "Eigen/Eigenvalues"
#include "Eigen/LU"
#include "Eigen/QR"
#include "Eigen/SVD"

// With `extern` these are declarations, with nothing definitions. That of a class
// leaves out its member templates. NOLINTBEGIN(bugprone-macro-parentheses): the
// argument is a keyword.
#define INVGRAD_EIGEN_DECOMPOSITIONS(EXTERN)                       \
  EXTERN template class ColPivHouseholderQR<MatrixXd>;             \
  EXTERN template class CompleteOrthogonalDecomposition<MatrixXd>; \
  EXTERN template class HouseholderQR<MatrixXd>;                   \
  EXTERN template class JacobiSVD<MatrixXd>;                       \
  EXTERN template class LLT<MatrixXd>;                             \
  EXTERN template class PartialPivLU<MatrixXd>;                    \
  EXTERN template class SelfAdjointEigenSolver<MatrixXd>;          \
  EXTERN template LLT<MatrixXd>& LLT<MatrixXd>::compute(           \
      const EigenBase<MatrixXd>&);                                 \
  EXTERN template SelfAdjointEigenSolver<MatrixXd>&                \
  SelfAdjointEigenSolver<MatrixXd>::compute(const EigenBase<MatrixXd>&, int);

namespace Eigen {
INVGRAD_EIGEN_DECOMPOSITIONS(extern)
}

// The kernels of Eigen 3.4's products; later versions have others.
#if !EIGEN_VERSION_AT_LEAST(3, 4, 90)
#define INVGRAD_EIGEN_PRODUCTS(EXTERN)               \
  EXTERN template struct gebp_kernel<double,         \
                                     double,         \
                                     Index,          \
                                     DoubleMapper,   \
                                     DoubleGebp::mr, \
                                     DoubleGebp::nr, \
                                     false,          \
                                     false>;         \
  INVGRAD_EIGEN_PRODUCTS_OF(EXTERN, ColMajor)        \
  INVGRAD_EIGEN_PRODUCTS_OF(EXTERN, RowMajor)
#define INVGRAD_EIGEN_PRODUCTS_OF(EXTERN, ORDER)                      \
  EXTERN template struct gemm_pack_lhs<double,                        \
                                       Index,                         \
                                       ConstDoubleMapper<ORDER>,      \
                                       DoubleGebp::mr,                \
                                       DoubleGebp::LhsProgress,       \
                                       DoubleGebp::LhsPacket4Packing, \
                                       ORDER>;                        \
  EXTERN template struct gemm_pack_rhs<double,                        \
                                       Index,                         \
                                       ConstDoubleMapper<ORDER>,      \
                                       DoubleGebp::nr,                \
                                       ORDER>;                        \
  EXTERN template struct general_matrix_vector_product<               \
      Index,                                                          \
      double,                                                         \
      ConstDoubleMapper<ORDER>,                                       \
      ORDER,                                                          \
      false,                                                          \
      double,                                                         \
      ConstDoubleMapper<ColMajor>,                                    \
      false,                                                          \
      0>;                                                             \
  EXTERN template struct general_matrix_vector_product<               \
      Index,                                                          \
      double,                                                         \
      ConstDoubleMapper<ORDER>,                                       \
      ORDER,                                                          \
      false,                                                          \
      double,                                                         \
      ConstDoubleMapper<RowMajor>,                                    \
      false,                                                          \
      0>;

namespace Eigen::internal {
using DoubleGebp = gebp_traits<double, double>;
using DoubleMapper = blas_data_mapper<double, Index, ColMajor, Unaligned, 1>;
template <int Order>
using ConstDoubleMapper = const_blas_data_mapper<double, Index, Order>;

INVGRAD_EIGEN_PRODUCTS(extern)
}  // namespace Eigen::internal
#endif
// NOLINTEND(bugprone-macro-parentheses)

#endif  // INVGRAD_CORE_EIGEN_TEMPLATES_H_
