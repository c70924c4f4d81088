// The loss of a batch on a curve of outputs that keep their invariant, without
// the simulator.
//
//   L(eta) = scale sum_s L_s(R_s(eta)),   R_s: Loss::Retract from y_s along t_s
//   dL/deta = scale sum_s g_s(R_s) . dR_s/deta
//
// Shapes:  y, y*: |y| x B, one column a sample;  t: m = |y| B, sample after
//          sample.
// Cost:    a gradient of the loss for each sample. Holds y and y*.
// Fails:   the result is NaN if a sample's loss has no finite value. CHECKs the
//          shapes.
#ifndef INVGRAD_CHAIN_LOSS_ON_CURVE_H_
#define INVGRAD_CHAIN_LOSS_ON_CURVE_H_

#include <functional>
#include <memory>

#include "Eigen/Core"
#include "invgrad/linearization.h"
#include "invgrad/loss.h"

namespace invgrad {

// Linearization::loss_on_curve. The sum has the order of the samples.
std::function<LossOnCurve(const Eigen::VectorXd& t, double eta)>
MakeLossOnCurve(std::shared_ptr<const Loss> loss,
                Eigen::MatrixXd outputs,
                Eigen::MatrixXd targets,
                double scale);

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_LOSS_ON_CURVE_H_
