// Rank and pseudo-inverse of J^T J for a few parameters, from the triangular
// factor R of J.
//
//   A = R D^-1 = U diag(s) V^T,   D = diag(|R e_i|) = diag(|J e_i|)
//   rank          the number of s > threshold s_max
//   undetermined  diag(V_0 V_0^T),  V_0: the other columns of V
//   covariance    (J^T J)^+ = P D^-1 V S^-2 V^T D^-1 P, of the s above
//
//   GramRoot<3> root = ...;  // streaming_gram.h
//   Eigen::Matrix3d covariance;
//   Eigen::Vector3d undetermined;
//   const int rank =
//       ComputeSmallCovariance<3>(root.R, 1e-7, &covariance, &undetermined);
//
// P = I - Z Z^T, Z: an orthonormal basis of the null space, the span of
// D^-1 V_0. Columns are scaled as in rank_report.h, so that neither the rank nor
// the undetermined shares depend on the units of the parameters. A column of
// zeros has D_i = 1.
//
// Shapes:  R, covariance: N x N, of which R's upper triangle is read;
//          undetermined: N.
// Cost:    N^3 operations if the norms of A and A^-1 show that the rank is N,
//          otherwise two singular value decompositions by Jacobi's method.
//          Without allocation.
// Fails:   R must be finite.
#ifndef INVGRAD_INTERNAL_SMALL_COVARIANCE_H_
#define INVGRAD_INTERNAL_SMALL_COVARIANCE_H_

#include <algorithm>
#include <cmath>

#include "Eigen/Core"
#include "Eigen/SVD"

namespace invgrad {

// Smaller undetermined shares are rounding errors: the data determine the
// parameter.
constexpr double kLeastUndeterminedShare = 1e-12;

// Of the columns of J that belong to one parameter block: the length below which
// a column holds nothing but rounding errors of the others. Parameters of other
// units have short columns, too, but the effect |J e_i| |x_i| has no unit.
class RoundingFloor {
 public:
  static constexpr double kRounding = 1e-13;

  void Add(double length, double x) {
    longest_ = std::max(longest_, length);
    largest_effect_ = std::max(largest_effect_, length * std::abs(x));
  }
  // For a direction without a value, such as a rotation.
  bool IsAbove(double length) const { return length <= kRounding * longest_; }
  // Where all values are zero, no effect tells rounding errors from a unit.
  bool IsAbove(double length, double x) const {
    return IsAbove(length) && largest_effect_ > 0.0 &&
           length * std::abs(x) <= kRounding * largest_effect_;
  }

 private:
  double longest_ = 0.0;
  double largest_effect_ = 0.0;
};

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
  int rank = 0;
  while (rank < N && s[rank] > threshold * s[0]) ++rank;
  // Columns are zero where they do not belong.
  Matrix kept = inverse_D.asDiagonal() * svd.matrixV();
  Matrix null_space = svd.matrixV();
  for (int i = 0; i < N; ++i) {
    if (i < rank) kept.col(i) /= s[i];
    (i < rank ? null_space : kept).col(i).setZero();
  }
  *covariance = kept * kept.transpose();
  *undetermined = null_space.rowwise().squaredNorm();
  if (rank < N) {
    null_space = (inverse_D.asDiagonal() * null_space).eval();
    const Eigen::JacobiSVD<Matrix> basis(null_space, Eigen::ComputeFullU);
    const Matrix& Z = basis.matrixU();
    Matrix P = Matrix::Identity();
    for (int i = 0; i < N - rank; ++i) P -= Z.col(i) * Z.col(i).transpose();
    // A determined parameter stays as it is, whatever the units of the others.
    for (int i = 0; i < N; ++i) {
      if ((*undetermined)[i] > kLeastUndeterminedShare) continue;
      P.row(i).setZero();
      P.col(i).setZero();
      P(i, i) = 1.0;
    }
    *covariance = (P * *covariance * P).eval();
  }
  return rank;
}

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_SMALL_COVARIANCE_H_
