// Nineteen least-squares problems of Moré, Garbow and Hillstrom [1], the usual
// test of a solver's starts: unlike scales, narrow valleys, flat regions.
//
//   L = 1/2 sum_i r_i(x)^2, from factor * start, factor = 1, 10, 100
//
// [1] Testing Unconstrained Optimization Software. ACM TOMS 7 (1981), 17-41,
//     section 3, problems 1 to 19.
#ifndef PROBLEMS_ESTIMATION_MORE_GARBOW_HILLSTROM_H_
#define PROBLEMS_ESTIMATION_MORE_GARBOW_HILLSTROM_H_

#include <functional>
#include <string>
#include <vector>

#include "ceres/cost_function.h"

namespace invgrad {

struct MoreGarbowHillstromRow {
  std::string name;           // "rosenbrock"
  std::vector<double> start;  // x, one parameter block
  double minimum;             // of sum_i r_i^2, the lowest known
  std::function<ceres::CostFunction*()> make_cost;  // the caller owns it
};

const std::vector<MoreGarbowHillstromRow>& MoreGarbowHillstrom();

// Whether the sum of squares is a solution: 4 digits of the minimum, or below
// 1e-8 where the minimum is 0.
bool IsSolution(const MoreGarbowHillstromRow& row, double sum_of_squares);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_MORE_GARBOW_HILLSTROM_H_
