#include "invgrad/inverse/loss_pull_back.h"

#include <limits>
#include <utility>

#include "Eigen/Eigenvalues"
#include "Eigen/LU"
#include "invgrad/chain/sample_error.h"
#include "invgrad/core/equilibration.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/scratch.h"
#include "invgrad/simulator.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Eigenvalues below this share of the largest count as zero.
constexpr double kZeroEigenvalue = 1e-12;

// *g <- |H|^-1 g, without the part along eigenvectors whose eigenvalue counts as
// zero. Returns false if there are any.
bool SolveSaddleFree(const MatrixXd& H, VectorXd* g) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(H);
  if (eigen.info() != Eigen::Success) {
    g->setConstant(std::numeric_limits<double>::quiet_NaN());
    return false;
  }
  const VectorXd lambda = eigen.eigenvalues().cwiseAbs();
  const double threshold = kZeroEigenvalue * lambda.maxCoeff();
  VectorXd coordinates = eigen.eigenvectors().transpose() * *g;
  for (Index i = 0; i < lambda.size(); ++i) {
    coordinates[i] = lambda[i] > threshold ? coordinates[i] / lambda[i] : 0.0;
  }
  *g = eigen.eigenvectors() * coordinates;
  return lambda.minCoeff() > threshold;
}

// *g <- H^-1 g. Returns false if H is singular up to rounding.
bool SolveNewton(const MatrixXd& H, VectorXd* g) {
  const Eigen::FullPivLU<MatrixXd> lu(H);
  if (!lu.isInvertible()) return false;
  *g = lu.solve(VectorXd(*g));
  return true;
}

// Solves in the units of y or, where H looks singular in these, in units in
// which its rows are alike. Returns false if it is singular in these, too.
bool SolveInAnyUnits(bool (*solve)(const MatrixXd& H, VectorXd* g),
                     const MatrixXd& H,
                     Map<VectorXd>* g) {
  VectorXd solution = *g;
  bool is_regular = solve(H, &solution);
  if (!is_regular) {
    const VectorXd d = EquilibrationOf(H);
    solution = d.cwiseProduct(*g);
    is_regular = solve(d.asDiagonal() * H * d.asDiagonal(), &solution);
    solution = d.cwiseProduct(solution);
  }
  *g = solution;
  return is_regular;
}

}  // namespace

LossPullBack::LossPullBack(std::shared_ptr<const Loss> loss,
                           LossWay way,
                           double step_size)
    : loss_(std::move(loss)), way_(way), step_size_(step_size) {
  CHECK(loss_ != nullptr);
  CHECK_GT(step_size, 0.0);
}

bool LossPullBack::Step(const double* y,
                        const double* target,
                        double* loss,
                        double* change,
                        std::string* why) const {
  Map<VectorXd> d(change, size());
  const bool is_gradient = way_ == LossWay::kGradient;
  const bool is_squared_norm = loss_->SquaredNormFactor().has_value();
  const bool needs_hessian =
      !is_gradient && way_ != LossWay::kTarget && !is_squared_norm;
  if (needs_hessian && !loss_->forms_hessian()) {
    *why =
        "the Hessian of the loss is too large to form; use target or gradient "
        "for the loss";
    return false;
  }
  Scratch<double> hessian(needs_hessian ? size() * size() : 0);
  if (!loss_->Evaluate(y,
                       target,
                       loss,
                       is_gradient || needs_hessian ? change : nullptr,
                       needs_hessian ? hessian.data() : nullptr)) {
    *why = kLossFailed;
    return false;
  }
  if (needs_hessian) {
    const MatrixXd H = Map<const MatrixXd>(hessian.data(), size(), size());
    const bool is_newton = way_ == LossWay::kNewton;
    if (!SolveInAnyUnits(is_newton ? SolveNewton : SolveSaddleFree, H, &d) &&
        is_newton) {
      *why = "the Hessian of the loss is singular; use saddle_free_newton";
      return false;
    }
  } else if (!is_gradient) {
    d = Map<const VectorXd>(y, size()) - Map<const VectorXd>(target, size());
  }
  d *= -step_size_;
  if (AllFinite(change, size())) return true;
  *why = "the step in y is not finite";
  return false;
}

OutputFunction LossPullBack::Lowered(const double* target) const {
  if (way_ != LossWay::kGradient) return nullptr;
  return [this, target](const double* y, double* F, double* descent) {
    std::string ignored;
    if (!Step(y, target, F, descent, &ignored)) return false;
    *F *= step_size_;
    return true;
  };
}

bool LossPullBack::Evaluate(const double* y,
                            const double* target,
                            double* loss,
                            double* gradient,
                            double* hessian) const {
  if (gradient == nullptr && hessian == nullptr) {
    return loss_->Evaluate(y, target, loss, nullptr, nullptr);
  }
  Scratch<double> change(size());
  std::string why;
  if (!Step(y, target, loss, change.data(), &why)) return false;
  if (gradient != nullptr) {
    Map<VectorXd>(gradient, size()) =
        -Map<const VectorXd>(change.data(), size());
  }
  if (hessian == nullptr) return true;
  Map<MatrixXd> H(hessian, size(), size());
  if (way_ != LossWay::kGradient) {
    H.setIdentity();
    return true;
  }
  if (!loss_->Evaluate(y, target, loss, nullptr, hessian)) return false;
  H *= step_size_;
  return true;
}

VectorXd LossPullBack::HessianTimes(const double* y,
                                    const double* target,
                                    const VectorXd& v) const {
  if (way_ != LossWay::kGradient) return v;
  return step_size_ * loss_->HessianTimes(y, target, v);
}

}  // namespace invgrad
