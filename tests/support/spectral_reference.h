// The filtered step in long double, straight from the definition, and spectra
// to test against it. Eigen's decompositions take long to compile: they are
// compiled once, here.
#ifndef INVGRAD_TESTS_SUPPORT_SPECTRAL_REFERENCE_H_
#define INVGRAD_TESTS_SUPPORT_SPECTRAL_REFERENCE_H_

#include <memory>
#include <random>

#include "Eigen/Core"
#include "invgrad/spectral.h"

namespace invgrad {

using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using LongVector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;

class RandomMatrices {
 public:
  explicit RandomMatrices(int seed) : generator_(seed) {}

  double Number() { return normal_(generator_); }
  Eigen::VectorXd Vector(int size);
  // m x n, with orthonormal columns; n <= m.
  LongMatrix Orthonormal(int m, int n);
  // Symmetric, entries normal with variance one.
  Eigen::MatrixXd Symmetric(int m);
  // U diag(s) V^T with k = min(m, n) values.
  Eigen::MatrixXd WithSpectrum(int m, int n, const Eigen::VectorXd& s);

 private:
  std::mt19937 generator_;
  std::normal_distribution<double> normal_;
};

// From 1 to `smallest`.
Eigen::VectorXd LogUniform(int size, double smallest);

// A threshold in the middle (of the logarithms) of the gap above s[i].
double TauAbove(const Eigen::VectorXd& s, int i);

// K = U diag(values) U^T for a symmetric K, values ascending.
struct SymmetricEigen {
  explicit SymmetricEigen(const Eigen::MatrixXd& K);

  Eigen::VectorXd values;
  Eigen::MatrixXd U;
};

class SpectralReference {
 public:
  explicit SpectralReference(const Eigen::MatrixXd& J);
  ~SpectralReference();

  const LongVector& s() const;
  long double s(int i) const { return s()[i]; }

  // U^T g.
  LongVector Components(const Eigen::VectorXd& g) const;

  LongVector Step(const SpectralFilter& filter, const Eigen::VectorXd& g) const;

  double RelativeError(const SpectralFilter& filter,
                       const Eigen::VectorXd& g,
                       const Eigen::VectorXd& d) const;

 private:
  long double Phi(const SpectralFilter& filter, long double value) const;

  struct Decompositions;
  std::unique_ptr<Decompositions> decompositions_;
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_SPECTRAL_REFERENCE_H_
