// Rank and pseudo-inverse of J^T J for a few parameters, from the triangular
// factor R of J.
//
//   A = R D^-1 = U diag(s) V^T,   D = diag(|R e_i|) = diag(|J e_i|)
//   rank          the number of s > threshold s_max
//   covariance    (J^T J)^+ = P D^-1 V S^-2 V^T D^-1 P, of these s
//   undetermined  diag(Z Z^T),   P = I - Z Z^T
//
//   GramRoot<3> root = ...;  // streaming_gram.h
//   Eigen::Matrix3d covariance;
//   Eigen::Vector3d undetermined;
//   const int rank =
//       ComputeSmallCovariance<3>(root.R, 1e-7, &covariance, &undetermined);
//
// Z is an orthonormal basis of the null space, D^-1 times the other columns of
// V. Columns are scaled as in rank_report.h, so that the rank has no units. A
// column of zeros has D_i = 1.
//
// Shapes:  R, covariance: N x N, of which R's upper triangle is read;
//          undetermined: N.
// Cost:    N^3 operations if the norms of A and A^-1 show that the rank is N,
//          otherwise two singular value decompositions by Jacobi's method.
//          Without allocation.
// Fails:   R must be finite.
#ifndef INVGRAD_INTERNAL_SMALL_COVARIANCE_H_
#define INVGRAD_INTERNAL_SMALL_COVARIANCE_H_

#include "Eigen/Core"
#include "Eigen/SVD"

namespace invgrad {

template <int N>
int ComputeSmallCovariance(const Eigen::Matrix<double, N, N>& R,
                           double threshold,
                           Eigen::Matrix<double, N, N>* covariance,
                           Eigen::Matrix<double, N, 1>* undetermined) {
  using Matrix = Eigen::Matrix<double, N, N>;
  using Vector = Eigen::Matrix<double, N, 1>;
  Matrix A = R.template triangularView<Eigen::Upper>();
  Vector inverse_D;
  for (int i = 0; i < N; ++i) {
    const double length = A.col(i).norm();
    inverse_D[i] = length > 0.0 ? 1.0 / length : 1.0;
  }
  A = (A * inverse_D.asDiagonal()).eval();
  // |A|_F |A^-1|_F bounds s_max / s_min.
  if ((A.diagonal().array() != 0.0).all()) {
    Matrix inverse = Matrix::Identity();
    A.template triangularView<Eigen::Upper>().solveInPlace(inverse);
    if (A.squaredNorm() * inverse.squaredNorm() * threshold * threshold < 1.0) {
      inverse = (inverse_D.asDiagonal() * inverse).eval();
      covariance->noalias() = inverse * inverse.transpose();
      undetermined->setZero();
      return N;
    }
  }
  const Eigen::JacobiSVD<Matrix> svd(A, Eigen::ComputeFullV);
  const Vector& s = svd.singularValues();
  const Matrix V = inverse_D.asDiagonal() * svd.matrixV();
  int rank = 0;
  while (rank < N && s[rank] > threshold * s[0]) ++rank;
  // Columns are zero where they do not belong.
  Matrix kept = V;
  Matrix motions = V;
  for (int i = 0; i < N; ++i) {
    if (i < rank) kept.col(i) /= s[i];
    (i < rank ? motions : kept).col(i).setZero();
  }
  *covariance = kept * kept.transpose();
  undetermined->setZero();
  if (rank < N) {
    const Eigen::JacobiSVD<Matrix> basis(motions, Eigen::ComputeFullU);
    const Matrix& U = basis.matrixU();
    Matrix P = Matrix::Identity();
    for (int i = 0; i < N - rank; ++i) P -= U.col(i) * U.col(i).transpose();
    *undetermined = U.leftCols(N - rank).rowwise().squaredNorm();
    *covariance = (P * *covariance * P).eval();
  }
  return rank;
}

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_SMALL_COVARIANCE_H_
