// The problems of Moré, Garbow and Hillstrom (more_garbow_hillstrom.h)
// as one problem of compare.
#ifndef PROBLEMS_MORE_GARBOW_HILLSTROM_PROBLEM_H_
#define PROBLEMS_MORE_GARBOW_HILLSTROM_PROBLEM_H_

#include <string>

#include "invgrad/compare/problem.h"
#include "invgrad/option_set.h"

namespace invgrad {

// Seed k multiplies each number of the start by 1 + spread z, z standard normal,
// np.random.seed(k).
struct MoreGarbowHillstromProblem {
  std::string function = "rosenbrock";
  double factor = 1.0;
  double spread = 0.0;
  void Describe(OptionSet* set);
  bool Create(LeastSquaresProblem* problem, std::string* error) const;
};

}  // namespace invgrad

#endif  // PROBLEMS_MORE_GARBOW_HILLSTROM_PROBLEM_H_
