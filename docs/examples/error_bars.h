// Error bars of a trained network by Laplace's approximation: what the data
// leave open about the weights, carried on to any function of them. For
// error_bars.cc.
//
//   r(w + d) ~ r + J d,   entries of r independent, of variance s^2
//   C = (J^T J / s^2 + P^-1)^-1                 the covariance of the weights
//     = P - P J^T (s^2 I + J P J^T)^-1 J P      for fewer rows than weights
//   deviation of f(w): sqrt(J_f C J_f^T)
//
// Noise:   from the residuals, s^2 = |r|^2 / (m - gamma). gamma = trace(J C J^T)
//          / s^2 is the number of weights that the data determine [1].
// Prior:   P = c P_0, where the diagonal P_0 is the variance of the initial
//          weights. kInitial: c = 1. kEvidence: c = w^T P_0^-1 w / gamma, so
//          that determined weights have the size that the prior expects [1].
//          Training has no decay of weights, and often leaves the initial size
//          far behind: then c = 1 contradicts the weights.
//
// Nothing is left to set. The deviations do not depend on the units of r. All
// is computed from the eigenvalues of the smaller Gram matrix of J sqrt(P_0).
//
// Shapes:  J: m x n;  r: m;  w, P_0: n;  J_f: k x n.
// Cost:    m n min(m, n) + 9 min(m, n)^3, and k n min(m, n) for f.
// Limits:  directions with singular values of J sqrt(P_0) below 1e-8 of the
//          largest are lost in rounding.
//
// [1] MacKay. Bayesian interpolation, and A practical Bayesian framework for
//     backpropagation networks. Neural Computation 4 (1992).
#ifndef ERROR_BARS_H_
#define ERROR_BARS_H_

#include <cmath>
#include <string>

#include "Eigen/Core"
#include "Eigen/Eigenvalues"
#include "glog/logging.h"
#include "invgrad/data.h"
#include "invgrad/dense_network.h"
#include "invgrad/linearization.h"
#include "invgrad/model.h"

namespace error_bars {

using Eigen::MatrixXd;
using Eigen::VectorXd;

enum class Prior { kInitial, kEvidence };

class ErrorBars {
 public:
  // initial_variance: the diagonal of P_0.
  ErrorBars(const MatrixXd& J,
            const VectorXd& r,
            const VectorXd& w,
            const VectorXd& initial_variance,
            Prior prior)
      : has_fewer_rows_(J.rows() < J.cols()),
        root_prior_(initial_variance.cwiseSqrt()) {
    const MatrixXd A = J * root_prior_.asDiagonal();
    MatrixXd gram;
    if (has_fewer_rows_) {
      gram.noalias() = A * A.transpose();
    } else {
      gram.noalias() = A.transpose() * A;
    }
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(gram);
    squares_ = eigen.eigenvalues().cwiseMax(0.0);
    vectors_ = eigen.eigenvectors();
    if (has_fewer_rows_) vectors_ = A.transpose() * vectors_;
    FindScales(r, w.cwiseQuotient(root_prior_).squaredNorm(), prior);
  }

  double noise_variance() const { return noise_; }       // s^2
  double prior_scale() const { return scale_; }          // c
  double num_determined() const { return determined_; }  // gamma

  // Of k functions f.
  VectorXd Deviations(const MatrixXd& J_f) const {
    const MatrixXd A_f = J_f * root_prior_.asDiagonal();
    const MatrixXd along = (A_f * vectors_).cwiseAbs2();
    const VectorXd damped = (scale_ * squares_.array() + noise_).inverse();
    const VectorXd variance =
        has_fewer_rows_
            ? VectorXd(A_f.rowwise().squaredNorm() - scale_ * along * damped)
            : VectorXd(noise_ * along * damped);
    return (scale_ * variance).cwiseMax(0.0).cwiseSqrt();
  }

 private:
  // The equations for s^2 and c are fixed points. Means of logarithms make the
  // iteration contract. size: w^T P_0^-1 w.
  void FindScales(const VectorXd& r, double size, Prior prior) {
    constexpr int kMaxIterations = 1000;
    constexpr double kTolerance = 1e-12;
    const Eigen::Index num_others = r.size() - squares_.size();
    noise_ = r.squaredNorm() / static_cast<double>(r.size());
    for (int i = 0; i < kMaxIterations && noise_ > 0.0; ++i) {
      const VectorXd open = noise_ / (scale_ * squares_.array() + noise_);
      determined_ = (1.0 - open.array()).sum();
      const double noise_factor =
          std::sqrt(r.squaredNorm() /
                    (noise_ * (static_cast<double>(num_others) + open.sum())));
      const double scale_factor =
          prior == Prior::kInitial ? 1.0
                                   : std::sqrt(size / (scale_ * determined_));
      noise_ *= noise_factor;
      scale_ *= scale_factor;
      if (std::abs(noise_factor - 1.0) < kTolerance &&
          std::abs(scale_factor - 1.0) < kTolerance) {
        break;
      }
    }
  }

  bool has_fewer_rows_;
  VectorXd root_prior_;  // sqrt(P_0)
  // Of the Gram matrix of A = J sqrt(P_0): the eigenvalues, and V or A^T U.
  VectorXd squares_;
  MatrixXd vectors_;
  double noise_ = 0.0;
  double scale_ = 1.0;
  double determined_ = 0.0;
};

// The variance of Glorot's initial weights, 2 / (fan_in + fan_out). Biases begin
// at zero; they have that of their layer.
inline VectorXd GlorotVariance(const invgrad::DenseNetwork& network) {
  VectorXd variance(network.num_weights());
  Eigen::Index begin = 0;
  for (int l = 0; l < network.num_layers(); ++l) {
    const int fan_in = network.widths()[l];
    const int fan_out = network.widths()[l + 1];
    const int count = (fan_in + 1) * fan_out;
    variance.segment(begin, count).setConstant(2.0 / (fan_in + fan_out));
    begin += count;
  }
  return variance;
}

// J = dy/dw and y - y* of a model whose loss is a squared norm.
struct Residuals {
  MatrixXd J;
  VectorXd r;
};

inline Residuals ResidualsOf(const invgrad::Model& model,
                             const VectorXd& weights,
                             const invgrad::DataSet& samples) {
  invgrad::Linearization at_w;
  std::string error;
  CHECK(model.Linearize(
      weights, samples, invgrad::LinearizationParts::Jacobian(), &at_w, &error))
      << error;
  const auto factor = model.loss().SquaredNormFactor();
  CHECK(factor.has_value()) << "the loss is not a squared norm";
  const double scale = 2.0 * *factor * model.BatchScale(samples.num_samples());
  Residuals residuals;
  at_w.jacobian->ToDense(&residuals.J);
  residuals.r = at_w.loss_gradient / scale;
  return residuals;
}

// Of a model's weights after training on the samples.
inline ErrorBars ErrorBarsOf(const invgrad::Model& model,
                             const VectorXd& weights,
                             const invgrad::DataSet& samples,
                             Prior prior) {
  const auto [J, r] = ResidualsOf(model, weights, samples);
  return ErrorBars(
      J, r, weights, GlorotVariance(*model.dense_network()), prior);
}

}  // namespace error_bars

#endif  // ERROR_BARS_H_
