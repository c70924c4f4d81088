// The least ridge of an output layer that is solved every few steps, from what
// the steps between two solutions did to it.
//
//   rho <- min(1, 8 rho)   if the mean squared residual of fresh samples, before
//                          a solution, is above 16 times that after the last one
//   rho <- rho / 2         otherwise
//   ridge = rho l_max
//
// Between two solutions the features drift, because the other weights move. The
// drift adds |dH^T C|^2 to the squared residual, as an error in the features
// would, and a ridge is the least-squares answer to errors in the features: it
// makes C small where that costs little. The best ridge for one set of samples
// (normal_equations.h) knows nothing of the drift, and where features are nearly
// dependent it allows a C so large that one step of the other weights undoes the
// fit.
//
// rho begins at 1e-4, so that the first solutions, which are far from the last
// ones, are cautious.
#ifndef INVGRAD_OUTPUT_LAYER_DRIFT_RIDGE_H_
#define INVGRAD_OUTPUT_LAYER_DRIFT_RIDGE_H_

#include <algorithm>

#include "Eigen/Core"

namespace invgrad {

class DriftRidge {
 public:
  // Before a solution, with the mean squared residual of its samples. Returns
  // rho.
  double RidgeFor(double mean_square) {
    double& rho = state_[0];
    const double last = state_[1];
    if (last >= 0.0) {
      rho = mean_square > kRise * last ? std::min(1.0, kRaise * rho)
                                       : std::max(kSmallest, rho / kFall);
    }
    return rho;
  }
  // After it.
  void SetResidual(double mean_square) { state_[1] = mean_square; }

  // rho, and the residual after the last solution; negative: none yet.
  Eigen::VectorXd* mutable_state() { return &state_; }

 private:
  static constexpr double kFirst = 1e-4;
  static constexpr double kSmallest = 1e-16;
  static constexpr double kRise = 16.0;
  static constexpr double kRaise = 8.0;
  static constexpr double kFall = 2.0;

  Eigen::VectorXd state_ = Eigen::Vector2d(kFirst, -1.0);
};

}  // namespace invgrad

#endif  // INVGRAD_OUTPUT_LAYER_DRIFT_RIDGE_H_
