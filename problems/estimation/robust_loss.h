// Robust loss functions of Ceres by name.
//
//   none, huber[:scale], soft_l_one[:scale], cauchy[:scale], arctan[:scale],
//   tukey[:scale]
//
// Units:   the scale has the units of the residual's norm; default 1.
#ifndef PROBLEMS_ESTIMATION_ROBUST_LOSS_H_
#define PROBLEMS_ESTIMATION_ROBUST_LOSS_H_

#include <functional>
#include <string>

#include "ceres/loss_function.h"

namespace invgrad {

// Makes a loss function, which the caller owns; null for "none".
using MakeLossFunction = std::function<ceres::LossFunction*()>;

// Returns false, with *error set, if the name is unknown or the scale is out of
// range.
bool ParseRobustLoss(const std::string& text,
                     MakeLossFunction* make_loss,
                     std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_ROBUST_LOSS_H_
