// The loss of one sample, with gradient and Hessian in y. Use SquaredNormLoss
// for squared distances; for another loss use autodiff_loss.h, or derive from
// Loss.
//
//   L(y, y*),   g = dL/dy,   H_L = d2L/dy2
//
// Shapes:  y, y*, g: size();  H_L: size() x size(), symmetric.
// Units:   L scales half-inverse steps, so the factor in front of the squared
//          norm is explicit: SquaredNormLoss(size, 0.5) is Ceres'
//          1/2 |y - y*|^2, SquaredNormLoss(size, 1.0) the |y - y*|^2 of the
//          HIG code.
// Cost:    a loss of a field, whose H_L is too large to form, has the products
//          H_L v instead (forms_hessian).
// Invariants: the outputs of some simulators keep a quantity, such as the norm
//          of a state. A straight line y + eta t leaves the set of such
//          outputs, and the model g . t + 1/2 t . H_L t is then wrong in second
//          order. A loss that says so (has_invariant) has a curve in this set
//          instead, R(eta) with R(0) = y and dR/deta(0) = t (Retract).
// Fails:   Evaluate returns false if the loss has no finite value.
#ifndef INVGRAD_LOSS_H_
#define INVGRAD_LOSS_H_

#include <optional>

#include "Eigen/Core"

namespace invgrad {

class Loss {
 public:
  virtual ~Loss() = default;

  virtual int size() const = 0;

  // Whether Evaluate gives H_L as a matrix. If not, `hessian` must be null.
  virtual bool forms_hessian() const { return true; }

  // `gradient` and `hessian` may be null.
  virtual bool Evaluate(const double* y,
                        const double* target,
                        double* loss,
                        double* gradient,
                        double* hessian) const = 0;

  // H_L v; by default from the matrix. NaN if the loss has no finite value.
  virtual Eigen::VectorXd HessianTimes(const double* y,
                                       const double* target,
                                       const Eigen::VectorXd& v) const;

  // Whether the outputs y that the loss is for keep a quantity, so that Retract
  // and not y + eta t moves them.
  virtual bool has_invariant() const { return false; }

  // The point R(eta) of the curve from y in the direction t, and dR/deta there;
  // all of size(). By default |y| is kept, and the curve is the great circle
  //
  //   R(eta) = cos(a) y + sin(a) |y|/|p| p,   a = eta |p|/|y|
  //
  // with p = t - (y . t)/|y|^2 y, the part of t that keeps |y|. With real and
  // imaginary parts as entries of y, this is the curve of complex states, too.
  // If p or y is zero, R(eta) = y.
  virtual void Retract(const double* y,
                       const double* t,
                       double eta,
                       double* moved,
                       double* velocity) const;

  // c, if the loss is c |y - y*|^2. Ceres' trust-region solvers need such a
  // least-squares problem.
  virtual std::optional<double> SquaredNormFactor() const {
    return std::nullopt;
  }
};

// L = factor |y - y*|^2.
class SquaredNormLoss final : public Loss {
 public:
  SquaredNormLoss(int size, double factor);
  int size() const override { return size_; }
  bool Evaluate(const double* y,
                const double* target,
                double* loss,
                double* gradient,
                double* hessian) const override;
  std::optional<double> SquaredNormFactor() const override { return factor_; }

 private:
  int size_;
  double factor_;
};

// L = y* . y: the covector y* as a loss. Its Hessian with respect to x or theta
// is the Hessian of the outputs, weighted by y*.
class DotProductLoss final : public Loss {
 public:
  explicit DotProductLoss(int size);
  int size() const override { return size_; }
  bool Evaluate(const double* y,
                const double* target,
                double* loss,
                double* gradient,
                double* hessian) const override;

 private:
  int size_;
};

}  // namespace invgrad

#endif  // INVGRAD_LOSS_H_
