#include "tests/support/spectral_reference.h"

#include <algorithm>
#include <cmath>

#include "Eigen/Eigenvalues"
#include "Eigen/QR"
#include "Eigen/SVD"

namespace invgrad {

Eigen::VectorXd RandomMatrices::Vector(int size) {
  return Eigen::VectorXd::NullaryExpr(size, [this]() { return Number(); });
}

LongMatrix RandomMatrices::Orthonormal(int m, int n) {
  const LongMatrix A =
      LongMatrix::NullaryExpr(m, n, [this]() { return normal_(generator_); });
  return Eigen::HouseholderQR<LongMatrix>(A).householderQ() *
         LongMatrix::Identity(m, n);
}

Eigen::MatrixXd RandomMatrices::Symmetric(int m) {
  Eigen::MatrixXd A(m, m);
  for (int j = 0; j < m; ++j) {
    A.col(j) = Vector(m);
    A.row(j).head(j) = A.col(j).head(j).transpose();
  }
  return A;
}

Eigen::MatrixXd RandomMatrices::WithSpectrum(int m,
                                             int n,
                                             const Eigen::VectorXd& s) {
  const int k = static_cast<int>(s.size());
  return (Orthonormal(m, k) * s.cast<long double>().asDiagonal() *
          Orthonormal(n, k).transpose())
      .cast<double>();
}

Eigen::VectorXd LogUniform(int size, double smallest) {
  return Eigen::VectorXd::NullaryExpr(size, [=](Eigen::Index i) {
    return size == 1 ? 1.0
                     : std::pow(smallest, static_cast<double>(i) / (size - 1));
  });
}

double TauAbove(const Eigen::VectorXd& s, int i) {
  return std::sqrt(s[i - 1] * s[i]) / s[0];
}

SymmetricEigen::SymmetricEigen(const Eigen::MatrixXd& K) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(K);
  values = eigen.eigenvalues();
  U = eigen.eigenvectors();
}

// A = Q R, or A^T if A is wide, and R = U S V^T: reducing the long side first
// saves most of the time.
struct SpectralReference::Decompositions {
  bool is_wide;
  Eigen::HouseholderQR<LongMatrix> qr;
  Eigen::JacobiSVD<LongMatrix> svd;
};

SpectralReference::SpectralReference(const Eigen::MatrixXd& J)
    : decompositions_(std::make_unique<Decompositions>()) {
  auto& [is_wide, qr, svd] = *decompositions_;
  const LongMatrix A = J.cast<long double>();
  is_wide = A.cols() > A.rows();
  if (is_wide) {
    qr.compute(A.transpose());
  } else {
    qr.compute(A);
  }
  const Eigen::Index k = std::min(A.rows(), A.cols());
  const LongMatrix R = qr.matrixQR().topRows(k).triangularView<Eigen::Upper>();
  svd.compute(R, Eigen::ComputeThinU | Eigen::ComputeThinV);
}

SpectralReference::~SpectralReference() = default;

const LongVector& SpectralReference::s() const {
  return decompositions_->svd.singularValues();
}

LongVector SpectralReference::Components(const Eigen::VectorXd& g) const {
  const auto& [is_wide, qr, svd] = *decompositions_;
  const LongVector long_g = g.cast<long double>();
  if (is_wide) return svd.matrixV().transpose() * long_g;
  const LongVector rotated = qr.householderQ().transpose() * long_g;
  return svd.matrixU().transpose() * rotated.head(s().size());
}

LongVector SpectralReference::Step(const SpectralFilter& filter,
                                   const Eigen::VectorXd& g) const {
  const auto& [is_wide, qr, svd] = *decompositions_;
  LongVector c = Components(g);
  for (Eigen::Index i = 0; i < c.size(); ++i) c[i] *= Phi(filter, s()[i]);
  if (!is_wide) return svd.matrixV() * c;
  LongVector d = LongVector::Zero(qr.rows());
  d.head(c.size()) = svd.matrixU() * c;
  return qr.householderQ() * d;
}

double SpectralReference::RelativeError(const SpectralFilter& filter,
                                        const Eigen::VectorXd& g,
                                        const Eigen::VectorXd& d) const {
  const LongVector exact = Step(filter, g);
  return static_cast<double>((d.cast<long double>() - exact).norm() /
                             exact.norm());
}

long double SpectralReference::Phi(const SpectralFilter& filter,
                                   long double value) const {
  const long double threshold = filter.tau * s()[0];
  if (!(value > threshold)) {
    if (!filter.clamp) return 0.0L;
    value = threshold;
  }
  const long double lambda =
      filter.damping + filter.relative_damping * s()[0] * s()[0];
  const long double exponent =
      (1.0L + static_cast<long double>(filter.kappa)) / 2.0L;
  // At zero, and without damping, this is 0 / 0 or a jump.
  return value > 0.0L ? value * std::pow(value * value + lambda, -exponent)
                      : 0.0L;
}

}  // namespace invgrad
