#include "invgrad/separable/reduced_cost.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "Eigen/Cholesky"
#include "invgrad/ceres/residual_evaluation.h"
#include "invgrad/separable/root_loss.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Reweighting converges linearly, by a factor of 0.1 to 0.5 for a few outliers.
constexpr int kMaxReweightings = 200;
constexpr int kMaxNewtonSteps = 100;      // where that does not converge
constexpr double kSameResiduals = 1e-12;  // relative
constexpr int kMaxHalvings = 30;

// dr -> df, for the columns of a residual block.
void ApplyRootLoss(const RootLoss& root,
                   const VectorXd& r,
                   Eigen::Ref<MatrixXd> dr) {
  const Eigen::RowVectorXd r_dr = r.transpose() * dr;
  dr = root.scale * (dr + root.beta * r * r_dr);
}

// Of 1/2 sum rho(|r_b|^2), damped: sqrt(rho') Phi dc = Q z, Q^T Q = I.
// Reweighting is the step -g.
//
//   ((1 - damping) H + damping I) z = -g,   g = Q^T (sqrt(rho') r)
//   H = I + sum_b 2 rho_b'' / rho_b' u_b u_b^T,   u_b = Q_b^T r_b
template <typename Blocks>
VectorXd NewtonStep(const Blocks& blocks,
                    const MatrixXd& Q,
                    const VectorXd& r,
                    const VectorXd& weights,
                    double damping) {
  const VectorXd g = Q.transpose() * weights.cwiseProduct(r);
  MatrixXd H = MatrixXd::Identity(Q.cols(), Q.cols());
  for (const auto& block : blocks) {
    if (block.loss_function == nullptr) continue;
    const auto r_b = r.segment(block.row, block.size);
    double rho[3];
    block.loss_function->Evaluate(r_b.squaredNorm(), rho);
    if (!(rho[1] > 0.0)) continue;
    const VectorXd u = Q.middleRows(block.row, block.size).transpose() * r_b;
    H += (1.0 - damping) * 2.0 * rho[2] / rho[1] * u * u.transpose();
  }
  const Eigen::LLT<MatrixXd> llt(H);
  if (llt.info() != Eigen::Success) return -g;
  return -llt.solve(g);
}

}  // namespace

ReducedCost::ReducedCost(ComponentResiduals residuals,
                         double rank_threshold,
                         bool is_golub_pereyra)
    : residuals_(std::move(residuals)),
      rank_threshold_(rank_threshold),
      is_golub_pereyra_(is_golub_pereyra),
      start_(residuals_.Linear()) {
  set_num_residuals(residuals_.num_residuals());
  for (const int b : residuals_.arguments()) {
    mutable_parameter_block_sizes()->push_back(residuals_.blocks()[b].size);
  }
  if (parameter_block_sizes().empty()) {
    mutable_parameter_block_sizes()->push_back(1);
  }
}

// 1/2 sum rho and the weights sqrt(rho') of all rows.
bool ReducedCost::RobustCost(const VectorXd& r,
                             double* cost,
                             VectorXd* weights,
                             std::string* error) const {
  *cost = 0.0;
  weights->resize(r.size());
  for (const auto& block : residuals_.residual_blocks()) {
    const double s = r.segment(block.row, block.size).squaredNorm();
    const RootLoss root(block.loss_function, s);
    if (!root.is_valid) {
      *error = ResidualBlockMessage(block.index,
                                    "variable projection needs a loss with rho "
                                    ">= 0 and rho' >= 0; minimize "
                                    "over all parameters by ceres::Solve");
      return false;
    }
    *cost += 0.5 * root.value;
    weights->segment(block.row, block.size).setConstant(root.weight);
  }
  return true;
}

bool ReducedCost::Reweight(const VectorXd& r_0,
                           const MatrixXd& Phi,
                           std::string* error) const {
  double cost;
  if (!ReweightFrom(start_, r_0, Phi, &cost, error)) return false;
  if (projection_->rank() == Phi.cols()) return true;
  const LinearProjection unweighted(Phi, rank_threshold_);
  if (projection_->rank() == unweighted.rank()) return true;
  // Rows beyond the width of a loss have no weight.
  const VectorXd c = c_;
  const VectorXd r = r_;
  const LinearProjection projection = *projection_;
  double other_cost;
  const VectorXd least_squares = -unweighted.Solve(r_0);
  std::string ignored;
  if (ReweightFrom(least_squares, r_0, Phi, &other_cost, &ignored) &&
      other_cost < cost) {
    return true;
  }
  c_ = c;
  r_ = r;
  projection_ = projection;
  return true;
}

bool ReducedCost::ReweightFrom(const VectorXd& start,
                               const VectorXd& r_0,
                               const MatrixXd& Phi,
                               double* lowest,
                               std::string* error) const {
  c_ = start;
  r_ = r_0 + Phi * c_;
  double& cost = *lowest;
  VectorXd weights;
  if (!RobustCost(r_, &cost, &weights, error)) return false;
  double damping = 0.1;
  for (int k = 0; k < kMaxReweightings + kMaxNewtonSteps; ++k) {
    const bool is_newton = k >= kMaxReweightings;
    projection_.emplace(weights.asDiagonal() * Phi, rank_threshold_);
    VectorXd change;
    if (is_newton) {
      const MatrixXd& Q = projection_->range();
      change = projection_->Solve(
          Q *
          NewtonStep(residuals_.residual_blocks(), Q, r_, weights, damping));
    } else {
      change = -projection_->Solve(weights.cwiseProduct(r_0)) - c_;
    }
    VectorXd r;
    double next_cost;
    VectorXd next_weights;
    int halvings = 0;
    for (; halvings <= kMaxHalvings; ++halvings, change *= 0.5) {
      r = r_0 + Phi * (c_ + change);
      if (!RobustCost(r, &next_cost, &next_weights, error)) return false;
      if (next_cost <= cost) break;
    }
    const bool has_fallen = halvings <= kMaxHalvings;
    // At a damping of 1 the step is that of reweighting: rounding errors.
    if (!has_fallen && (!is_newton || damping == 1.0)) break;
    if (is_newton) {
      damping = std::clamp(damping * (halvings > 0 ? 10.0 : 0.1), 1e-10, 1.0);
    }
    if (!has_fallen) continue;
    const double moved = (r - r_).norm();
    c_ += change;
    r_ = r;
    cost = next_cost;
    weights = next_weights;
    if (moved <= kSameResiduals * (r_0.norm() + r.norm())) break;
  }
  return true;
}

bool ReducedCost::SolveAt(const double* const* alpha,
                          std::string* error) const {
  std::vector<double> state;
  for (const auto& block : residuals_.blocks()) {
    if (block.argument < 0 && !block.linear.empty()) continue;
    const double* values =
        block.argument < 0 ? block.values : alpha[block.argument];
    state.insert(state.end(), values, values + block.size);
  }
  if (projection_ && state == state_) return true;
  projection_.reset();
  VectorXd r_0;
  MatrixXd Phi;
  if (!residuals_.Evaluate(alpha,
                           VectorXd::Zero(residuals_.num_linear()),
                           &r_0,
                           nullptr,
                           &Phi,
                           error)) {
    return false;
  }
  if (!residuals_.has_loss()) {
    projection_.emplace(Phi, rank_threshold_);
    c_ = -projection_->Solve(r_0);
    r_ = projection_->Residual(r_0);
  } else if (!Reweight(r_0, Phi, error)) {
    projection_.reset();
    return false;
  }
  state_ = std::move(state);
  return true;
}

bool ReducedCost::Solve(const double* const* alpha,
                        VectorXd* c,
                        std::string* error) const {
  if (!SolveAt(alpha, error)) return false;
  *c = c_;
  return true;
}

// J -= (Phi^+)^T G
bool ReducedCost::SubtractPhiTerm(const double* const* alpha,
                                  MatrixXd* J) const {
  const int p = residuals_.num_linear();
  std::string error;
  VectorXd r;
  MatrixXd A_0;
  MatrixXd A_j;
  MatrixXd G(p, J->cols());
  if (!residuals_.Evaluate(
          alpha, VectorXd::Zero(p), &r, &A_0, nullptr, &error)) {
    return false;
  }
  for (int j = 0; j < p; ++j) {
    VectorXd c = VectorXd::Zero(p);
    c[j] = c_[j] != 0.0 ? c_[j] : 1.0;
    if (!residuals_.Evaluate(alpha, c, &r, &A_j, nullptr, &error)) return false;
    G.row(j) = r_.transpose() * (A_j - A_0) / c[j];
  }
  *J -= projection_->SolveTransposed(G);
  return true;
}

bool ReducedCost::Jacobian(const double* const* alpha, MatrixXd* J) const {
  std::string error;
  VectorXd r;
  MatrixXd Phi;
  const bool has_loss = residuals_.has_loss();
  if (!residuals_.Evaluate(
          alpha, c_, &r, J, has_loss ? &Phi : nullptr, &error)) {
    return false;
  }
  if (!has_loss) {
    *J = projection_->Residual(*J);
    return !is_golub_pereyra_ || SubtractPhiTerm(alpha, J);
  }
  for (const auto& block : residuals_.residual_blocks()) {
    const VectorXd r_b = r_.segment(block.row, block.size);
    const RootLoss root(block.loss_function, r_b.squaredNorm());
    ApplyRootLoss(root, r_b, J->middleRows(block.row, block.size));
    ApplyRootLoss(root, r_b, Phi.middleRows(block.row, block.size));
  }
  *J = LinearProjection(Phi, rank_threshold_).Residual(*J);
  start_ = c_;
  return true;
}

bool ReducedCost::Evaluate(double const* const* alpha,
                           double* f,
                           double** jacobians) const {
  std::string error;
  if (!SolveAt(alpha, &error)) return false;
  for (const auto& block : residuals_.residual_blocks()) {
    const auto r_b = r_.segment(block.row, block.size);
    const RootLoss root(block.loss_function, r_b.squaredNorm());
    Eigen::Map<VectorXd>(f + block.row, block.size) = root.scale * r_b;
  }
  if (jacobians == nullptr) return true;
  MatrixXd J;
  if (!Jacobian(alpha, &J)) return false;
  for (std::size_t a = 0; a < residuals_.arguments().size(); ++a) {
    if (jacobians[a] == nullptr) continue;
    const auto& block = residuals_.blocks()[residuals_.arguments()[a]];
    Eigen::Map<RowMajorMatrix>(jacobians[a], num_residuals(), block.size) =
        J.middleCols(block.column, block.size);
  }
  return true;
}

}  // namespace invgrad
