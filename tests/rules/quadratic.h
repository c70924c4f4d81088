// Quadratic losses in which every rule finds what it needs, for tests.
#ifndef INVGRAD_TESTS_RULES_QUADRATIC_H_
#define INVGRAD_TESTS_RULES_QUADRATIC_H_

#include <memory>
#include <random>

#include "Eigen/Core"
#include "invgrad/chain/network_jacobian.h"
#include "invgrad/linearization.h"

namespace invgrad {

// The rules that decompose J.
inline constexpr const char* kSpectralRules[] = {"power",
                                                 "half_inverse",
                                                 "gauss_newton",
                                                 "levenberg_marquardt",
                                                 "layer_half_inverse",
                                                 "kfac_half_inverse"};

// A as the Jacobian of a network of one linear unit over samples with one
// output each, row s is delta_s (a_s, 1): a J in which every rule finds what it
// needs. The last column of A must have no zero.
inline std::shared_ptr<const JacobianOperator> OneUnit(
    const Eigen::MatrixXd& A) {
  const int num_inputs = static_cast<int>(A.cols()) - 1;
  const DenseNetwork network({num_inputs, 1}, Activation::kTanh);
  const Eigen::VectorXd weights = Eigen::VectorXd::Zero(A.cols());
  const Eigen::VectorXd delta = A.col(num_inputs);
  DenseNetwork::Activations activations;
  network.Forward(
      weights,
      (delta.cwiseInverse().asDiagonal() * A.leftCols(num_inputs)).transpose(),
      false,
      &activations);
  return std::make_shared<NetworkJacobian>(
      network, weights, activations, delta.transpose());
}

// L = 1/2 |A x - b|^2 with normally distributed A, m x n, and b.
class Quadratic {
 public:
  Quadratic(int m, int n) {
    std::mt19937 generator(100 * m + n);
    std::normal_distribution<double> normal;
    const auto next = [&]() { return normal(generator); };
    A_ = Eigen::MatrixXd::NullaryExpr(m, n, next);
    b_ = Eigen::VectorXd::NullaryExpr(m, next);
  }

  double Cost(const Eigen::VectorXd& x) const {
    return 0.5 * (A_ * x - b_).squaredNorm();
  }

  Linearization At(const Eigen::VectorXd& x) const {
    Linearization at_x;
    at_x.cost = Cost(x);
    at_x.loss_gradient = A_ * x - b_;
    at_x.jacobian = OneUnit(A_);
    at_x.gradient = A_.transpose() * at_x.loss_gradient;
    at_x.hessian = A_.transpose() * A_;
    at_x.hessian_times = [H = at_x.hessian](const auto& v, auto* Hv, auto*) {
      *Hv = H * v;
      return true;
    };
    at_x.after = [*this, x](const Eigen::VectorXd& step,
                            const LinearizationParts&,
                            Linearization* after,
                            std::string*) {
      *after = At(x + step);
      return true;
    };
    return at_x;
  }

  const Eigen::MatrixXd& A() const { return A_; }

 private:
  Eigen::MatrixXd A_;  // m x n
  Eigen::VectorXd b_;  // m
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_RULES_QUADRATIC_H_
