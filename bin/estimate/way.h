// A way to minimize an estimation problem: by a method, over all parameters or
// over the nonlinear ones, from which the linear ones follow; ceres_lm+chordal
// from relaxed poses (chordal_rule.h).
#ifndef BIN_ESTIMATE_WAY_H_
#define BIN_ESTIMATE_WAY_H_

#include <string>
#include <vector>

#include "ceres/problem.h"
#include "invgrad/method.h"
#include "invgrad/minimize.h"
#include "problems/estimation/estimation.h"

namespace invgrad {

struct Way {
  Method method;
  bool is_separable = false;
  std::string label;  // "ceres_lm", "ceres_lm separable"
};

// One or two ways for each method. `separable`: off, on or both.
std::vector<Way> Ways(const std::vector<Method>& methods,
                      const std::string& separable);

// Returns false, before anything runs, if the method does not apply
// (MinimizeProblem), if Ceres' minimizer does not have the linear solver of the
// problem, or if no parameter of a separable way is linear.
bool MinimizeByWay(const Way& way,
                   const MinimizerOptions& options,
                   Estimation* estimation,
                   ceres::Problem* problem,
                   MinimizerSummary* summary,
                   std::string* error);

}  // namespace invgrad

#endif  // BIN_ESTIMATE_WAY_H_
