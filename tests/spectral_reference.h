// The filtered step in long double, straight from the definition, and spectra
// to test against it.
#ifndef TESTS_SPECTRAL_REFERENCE_H_
#define TESTS_SPECTRAL_REFERENCE_H_

#include <algorithm>
#include <cmath>
#include <random>

#include "Eigen/QR"
#include "Eigen/SVD"
#include "invgrad/linalg/spectral_filter.h"

namespace invgrad {

using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using LongVector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;

class RandomMatrices {
 public:
  explicit RandomMatrices(int seed) : generator_(seed) {}

  Eigen::VectorXd Vector(int size) {
    return Eigen::VectorXd::NullaryExpr(
        size, [this]() { return normal_(generator_); });
  }
  // m x n, with orthonormal columns; n <= m.
  LongMatrix Orthonormal(int m, int n) {
    const LongMatrix A =
        LongMatrix::NullaryExpr(m, n, [this]() { return normal_(generator_); });
    return Eigen::HouseholderQR<LongMatrix>(A).householderQ() *
           LongMatrix::Identity(m, n);
  }
  // U diag(s) V^T with k = min(m, n) values.
  Eigen::MatrixXd WithSpectrum(int m, int n, const Eigen::VectorXd& s) {
    const int k = static_cast<int>(s.size());
    return (Orthonormal(m, k) * s.cast<long double>().asDiagonal() *
            Orthonormal(n, k).transpose())
        .cast<double>();
  }

 private:
  std::mt19937 generator_;
  std::normal_distribution<double> normal_;
};

// From 1 to `smallest`.
inline Eigen::VectorXd LogUniform(int size, double smallest) {
  return Eigen::VectorXd::NullaryExpr(size, [=](Eigen::Index i) {
    return size == 1 ? 1.0
                     : std::pow(smallest, static_cast<double>(i) / (size - 1));
  });
}

// A threshold in the middle (of the logarithms) of the gap above s[i].
inline double TauAbove(const Eigen::VectorXd& s, int i) {
  return std::sqrt(s[i - 1] * s[i]) / s[0];
}

class SpectralReference {
 public:
  explicit SpectralReference(const Eigen::MatrixXd& J) {
    // The long side is reduced first, which saves most of the time.
    const LongMatrix A = J.cast<long double>();
    wide_ = A.cols() > A.rows();
    if (wide_) {
      qr_.compute(A.transpose());
    } else {
      qr_.compute(A);
    }
    const Eigen::Index k = std::min(A.rows(), A.cols());
    const LongMatrix R =
        qr_.matrixQR().topRows(k).template triangularView<Eigen::Upper>();
    svd_.compute(R, Eigen::ComputeThinU | Eigen::ComputeThinV);
  }

  const LongVector& s() const { return svd_.singularValues(); }
  long double s(int i) const { return s()[i]; }

  LongVector Step(const SpectralFilter& filter,
                  const Eigen::VectorXd& g) const {
    const Eigen::Index k = s().size();
    LongVector c = g.cast<long double>();
    if (wide_) {
      c = svd_.matrixV().transpose() * c;
    } else {
      c = (qr_.householderQ().transpose() * c).eval();
      c = (svd_.matrixU().transpose() * c.head(k)).eval();
    }
    for (Eigen::Index i = 0; i < k; ++i) c[i] *= Phi(filter, s()[i]);
    if (!wide_) return svd_.matrixV() * c;
    LongVector d = LongVector::Zero(qr_.rows());
    d.head(k) = svd_.matrixU() * c;
    return qr_.householderQ() * d;
  }

  double RelativeError(const SpectralFilter& filter,
                       const Eigen::VectorXd& g,
                       const Eigen::VectorXd& d) const {
    const LongVector exact = Step(filter, g);
    return static_cast<double>((d.cast<long double>() - exact).norm() /
                               exact.norm());
  }

 private:
  long double Phi(const SpectralFilter& filter, long double value) const {
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

  bool wide_;
  Eigen::HouseholderQR<LongMatrix> qr_;
  Eigen::JacobiSVD<LongMatrix> svd_;
};

}  // namespace invgrad

#endif  // TESTS_SPECTRAL_REFERENCE_H_
