// Nineteen least-squares problems of Moré, Garbow and Hillstrom [1], the usual
// test of a solver's starts: unlike scales, narrow valleys, flat regions.
//
//   L = 1/2 sum_i r_i(x)^2, from factor * start, factor = 1, 10, 100
//
// Ten of them also within bounds [2], most of which exclude the free minimum.
//
// [1] Testing Unconstrained Optimization Software. ACM TOMS 7 (1981), 17-41,
//     section 3, problems 1 to 19.
// [2] Gay. A Trust-Region Approach to Linearly Constrained Optimization. LNM
//     1066 (1984), 72-105; bounds and minima as in Ceres' example
//     more_garbow_hillstrom.cc.
#ifndef PROBLEMS_MORE_GARBOW_HILLSTROM_H_
#define PROBLEMS_MORE_GARBOW_HILLSTROM_H_

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ceres/cost_function.h"
#include "ceres/problem.h"

namespace invgrad {

struct MoreGarbowHillstromRow {
  std::string name;           // "rosenbrock"
  std::vector<double> start;  // x, one parameter block
  double minimum;             // of sum_i r_i^2, the lowest known
  std::function<ceres::CostFunction*()> make_cost;  // the caller owns it
  std::vector<double> lower, upper;                 // empty: no bounds
};

const std::vector<MoreGarbowHillstromRow>& MoreGarbowHillstrom();
// The ten rows with bounds, and their minima within them.
const std::vector<MoreGarbowHillstromRow>& BoundedMoreGarbowHillstrom();

// A problem of the row's cost, with its bounds, on x; x outlives it.
std::unique_ptr<ceres::Problem> MakeMoreGarbowHillstrom(
    const MoreGarbowHillstromRow& row, std::vector<double>* x);

// sum_i r_i^2 at the state of the problem. (Solver::Summary::final_cost may be
// that of a step that Ceres rejected.)
double SumOfSquares(ceres::Problem* problem);

// Whether the sum of squares is a solution: 4 digits of the minimum, or below
// 1e-8 where the minimum is 0.
bool IsSolution(const MoreGarbowHillstromRow& row, double sum_of_squares);

}  // namespace invgrad

#endif  // PROBLEMS_MORE_GARBOW_HILLSTROM_H_
