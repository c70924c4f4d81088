#include "invgrad/inverse/newton_inverse.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "Eigen/Eigenvalues"
#include "Eigen/Jacobi"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/scratch.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Relative rounding errors of an eigenvalue that is the geometric mean, and of
// the slope along a direction that P does not depend on.
constexpr double kEigenvalueRounding = 1e-12;
constexpr double kFlatSlope = 1e-14;

// *x -= Q d, given the eigenvalues and Q^T g.
template <typename Lambda, typename Q>
void Step(const Lambda& lambda,
          const Q& eigenvectors,
          const NewtonInverse::Options& options,
          const Map<const VectorXd>& g,
          Map<VectorXd>* x) {
  // The geometric mean; 0 if an eigenvalue is zero.
  const double mean = std::exp(lambda.array().abs().log().mean());
  const double bounded_below = (1.0 + kEigenvalueRounding) * mean;
  const double flat = kFlatSlope * g.norm();
  for (Index i = 0; i < lambda.size(); ++i) {
    const double slope = eigenvectors.col(i).dot(g);
    if (std::abs(slope) <= flat) continue;
    const double newton =
        std::abs(slope) / (std::abs(lambda[i]) + options.damping);
    const double bound = lambda[i] > bounded_below
                             ? newton
                             : options.max_loss_change / std::abs(slope);
    *x -= std::copysign(std::min(newton, bound), slope) * eigenvectors.col(i);
  }
}

// One rotation solves an eigenvalue problem of size two.
void SaddleFreeStep(const Map<const MatrixXd>& H,
                    const Map<const VectorXd>& g,
                    const NewtonInverse::Options& options,
                    Map<VectorXd>* x) {
  if (H.rows() == 2) {
    Eigen::JacobiRotation<double> rotation;
    rotation.makeJacobi(H(0, 0), H(1, 0), H(1, 1));
    Eigen::Matrix2d D = H;
    D.applyOnTheLeft(0, 1, rotation.adjoint());
    D.applyOnTheRight(0, 1, rotation);
    Eigen::Matrix2d Q = Eigen::Matrix2d::Identity();
    Q.applyOnTheRight(0, 1, rotation);
    Step(Eigen::Vector2d(D.diagonal()), Q, options, g, x);
    return;
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(MatrixXd{H});
  Step(eigen.eigenvalues(), eigen.eigenvectors(), options, g, x);
}

}  // namespace

NewtonInverse::NewtonInverse(std::shared_ptr<const Simulator> simulator,
                             const Options& options)
    : simulator_(std::move(simulator)), options_(options) {
  CHECK(simulator_ != nullptr);
  std::string error;
  CHECK(CheckHasHessian(*simulator_, &error)) << error;
  CHECK_GE(options.num_steps, 1);
  CHECK_GT(options.max_loss_change, 0.0);
  CHECK_GE(options.damping, 0.0);
}

bool NewtonInverse::Invert(const ConstVectorRef& y,
                           const ConstVectorRef& x_now,
                           const ConstVectorRef& context,
                           VectorXd* x,
                           std::string* why) const {
  const Index n = simulator_->num_inputs();
  const Index m = simulator_->num_outputs();
  CHECK_EQ(x_now.size(), n);
  CHECK_EQ(y.size(), m);
  CHECK_EQ(context.size(), simulator_->num_context());
  Scratch<double> r_values(m);
  Scratch<double> J_values(m * n);
  Scratch<double> g_values(n);
  Scratch<double> H_values(n * n);
  Map<VectorXd> r(r_values.data(), m);
  const Map<const MatrixXd> J_transposed(J_values.data(), n, m);
  Map<VectorXd> g(g_values.data(), n);
  Map<MatrixXd> H(H_values.data(), n, n);
  *x = x_now;
  for (int step = 0; step < options_.num_steps; ++step) {
    if (!simulator_->Evaluate(
            x->data(), context.data(), r.data(), J_values.data())) {
      *why = "the simulator has no finite value";
      return false;
    }
    r -= y;
    if (!simulator_->WeightedHessian(
            x->data(), context.data(), r.data(), H.data())) {
      *why = "the simulator has no finite second derivative";
      return false;
    }
    // A lazy product, because the sizes are too small for Eigen's blocked
    // product.
    g.noalias() = J_transposed.lazyProduct(r);
    H.noalias() += J_transposed.lazyProduct(J_transposed.transpose());
    if (!g.allFinite() || !H.allFinite()) {
      *why = "a derivative of the squared distance is not finite";
      return false;
    }
    Map<VectorXd> x_map(x->data(), n);
    SaddleFreeStep(Map<const MatrixXd>(H.data(), n, n),
                   Map<const VectorXd>(g.data(), n),
                   options_,
                   &x_map);
  }
  return true;
}

}  // namespace invgrad
