#include <lapacke.h>

#include <cmath>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/rules/damped_normal_equations.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

class DenseNormalEquations final : public DampedNormalEquations {
 public:
  bool SetJacobian(const JacobianOperator& J,
                   double c,
                   std::string* error) override {
    J_ = &J;
    c_ = c;
    is_dual_ = J.rows() < J.cols();
    if (is_dual_) {
      J.Gram(&gram_);
    } else {
      J.ParameterGram(&gram_);
    }
    squared_norm_ = gram_.trace();
    if (std::isfinite(squared_norm_)) return true;
    *error = "the Jacobian is not finite";
    return false;
  }

  double Norm() const override { return std::sqrt(squared_norm_); }

  bool LimitBend(const VectorXd& v, VectorXd* a) const override {
    constexpr double kLongest = 0.75;
    return a->norm() < kLongest * v.norm();
  }

  bool Factorize(double lambda) override {
    factor_ = c_ * gram_;
    factor_.diagonal().array() += lambda * c_ * squared_norm_;
    const auto k = static_cast<lapack_int>(factor_.rows());
    return LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'L', k, factor_.data(), k) == 0;
  }

  VectorXd Solve(const VectorXd& w) const override {
    VectorXd solution = w;
    if (!is_dual_) J_->TransposeTimes(w, &solution);
    const auto k = static_cast<lapack_int>(factor_.rows());
    LAPACKE_dpotrs(
        LAPACK_COL_MAJOR, 'L', k, 1, factor_.data(), k, solution.data(), k);
    if (!is_dual_) return solution;
    VectorXd pulled;
    J_->TransposeTimes(solution, &pulled);
    return pulled;
  }

 private:
  const JacobianOperator* J_ = nullptr;
  double c_ = 1.0;
  bool is_dual_ = false;
  double squared_norm_ = 0.0;
  MatrixXd gram_;  // lower triangle
  MatrixXd factor_;
};

}  // namespace

std::unique_ptr<DampedNormalEquations> MakeDenseNormalEquations() {
  return std::make_unique<DenseNormalEquations>();
}

}  // namespace invgrad
