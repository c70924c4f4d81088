// The table of Ceres' minimizers: name -> one line -> options.
//
//   name                     Ceres
//   ceres_lm                 trust region, Levenberg-Marquardt
//   ceres_dogleg             trust region, dogleg
//   ceres_bfgs               line search, BFGS
//   ceres_lbfgs              line search, L-BFGS
//   ceres_nonlinear_cg       line search, nonlinear conjugate gradients
//   ceres_steepest_descent   line search, steepest descent
//
// A trust region needs a least-squares problem; a line search also takes a
// ceres::FirstOrderFunction.
#ifndef INVGRAD_METHODS_CERES_METHODS_H_
#define INVGRAD_METHODS_CERES_METHODS_H_

#include <functional>
#include <string>
#include <vector>

#include "ceres/solver.h"
#include "invgrad/option_set.h"
#include "invgrad/rules.h"

namespace invgrad {

// The message for a loss that is not a least-squares problem, which a trust
// region needs.
constexpr char kNeedsLeastSquares[] =
    "a trust region needs a least-squares loss, c |y - y*|^2";

struct CeresMethodRow {
  std::string name;
  std::string formula;  // one line
  bool is_trust_region;
  std::function<std::vector<OptionSet::Row>()> options;
  // Overwrites *options by the settings; false with *error set if one is
  // unknown or out of range.
  std::function<bool(const Settings& settings,
                     ceres::Solver::Options* options,
                     std::string* error)>
      configure;
};

const std::vector<CeresMethodRow>& CeresMethods();
const CeresMethodRow* FindCeresMethod(const std::string& name);

}  // namespace invgrad

#endif  // INVGRAD_METHODS_CERES_METHODS_H_
