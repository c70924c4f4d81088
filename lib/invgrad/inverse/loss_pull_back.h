// The first part of a pull-back: from the loss to a wanted change of the
// simulator's output.
//
//   gradient            d_y = -eta g
//   Newton              d_y = -eta H_L^-1 g
//   saddle-free Newton  d_y = -eta |H_L|^-1 g
//   target              d_y = eta (y* - y)
//
// where H_L is the Hessian in y, so the step does not depend on simulator and
// network. For L = c |y - y*|^2 both Newton steps are the target's, without a
// Hessian. The target is for a loss that is lowest at y*, and whose Hessian is
// singular or too large: y* is then an output of the simulator to aim at.
//
// Shapes:  y, y*, g, d_y: loss size;  H_L: size x size, of one sample.
// Units:   a Newton step has the units of y, a gradient step [L]/[y].
// Cost:    one loss; a general Newton step adds one Hessian and size^3 / 3
//          operations (saddle-free: 9 size^3, and twice that where H_L is
//          singular).
// Fails:   returns false if the loss has no finite value, if H_L is singular
//          (Newton), or if the loss does not form it (both Newton steps). Where
//          H_L looks singular in the units of y (saddle-free: an |eigenvalue| is
//          below 1e-12 of the largest), both steps are those in units in which
//          its rows are alike (equilibration.h). The saddle-free step is zero
//          along eigenvectors that have such an eigenvalue there, too.
//
// Source:  Holl, Koltun, Thuerey, arXiv 2109.15048, section 3.2; PBDL, chapter
//          physgrad-nn.
#ifndef INVGRAD_INVERSE_LOSS_PULL_BACK_H_
#define INVGRAD_INVERSE_LOSS_PULL_BACK_H_

#include <memory>
#include <string>

#include "invgrad/inverse/descents.h"
#include "invgrad/loss.h"

namespace invgrad {

enum class LossWay { kGradient, kNewton, kSaddleFreeNewton, kTarget };
// In the order of the enumerators.
inline constexpr const char* kLossWayNames[] = {
    "gradient", "newton", "saddle_free_newton", "target"};

// As a loss, for a joint update of network and simulator towards y~ = y + d_y:
// the value of L, the gradient -d_y, and the Hessian of 1/2 |y - y~|^2 for
// constant y~ (of eta L, for a gradient step).
class LossPullBack final : public Loss {
 public:
  // eta > 0.
  LossPullBack(std::shared_ptr<const Loss> loss, LossWay way, double step_size);

  // Computes L and the wanted change (size). *why is only set on failure.
  bool Step(const double* y,
            const double* target,
            double* loss,
            double* change,
            std::string* why) const;

  // eta L, whose descent in y is the gradient step; null for the other ways,
  // which descend no function. *this and the target must outlive it.
  OutputFunction Lowered(const double* target) const;

  int size() const override { return loss_->size(); }
  bool Evaluate(const double* y,
                const double* target,
                double* loss,
                double* gradient,
                double* hessian) const override;
  bool forms_hessian() const override { return loss_->forms_hessian(); }
  Eigen::VectorXd HessianTimes(const double* y,
                               const double* target,
                               const Eigen::VectorXd& v) const override;

 private:
  std::shared_ptr<const Loss> loss_;
  LossWay way_;
  double step_size_;  // eta
};

}  // namespace invgrad

#endif  // INVGRAD_INVERSE_LOSS_PULL_BACK_H_
