// What a sweep runs: the points of a grid, and the runs that they need.
//
// An axis is `rule`, `seed`, `batch_size`, a setting of the network
// (network_settings.h), an option of the problem, or an option of rules. The
// last kind is given to every rule that has the option and does not set it
// itself, of a method in phases to the last one: any other is run once, and its
// result stands at all of the axis' values.
//
// Fails:   false, with *error naming axis or value, for an axis that is not
//          known (with the nearest names), a value that is not allowed, a
//          problem without a network, and a batch larger than the data.
#ifndef BIN_SWEEP_PLAN_H_
#define BIN_SWEEP_PLAN_H_

#include <memory>
#include <string>
#include <vector>

#include "bin/support/network_settings.h"
#include "bin/sweep/grid.h"
#include "invgrad/methods/method.h"
#include "problems/problem.h"

namespace invgrad {

// One training run.
struct SweepJob {
  std::string name;  // of its directory
  std::shared_ptr<const LearningProblem> problem;
  Method method;
  int batch_size = 0;  // at least 1; of a method that has none of its own
  int seed = 0;
};

// One line of the results.
struct SweepPoint {
  std::vector<int> at;  // for every axis, which of its values
  int alternative = 0;  // of the rule there
  int job = 0;
};

struct SweepPlan {
  Grid grid;          // with the axis `seed`, which the user may leave out
  int rule_axis = 0;  // its number in grid.axes
  int seed_axis = 0;
  std::vector<std::vector<RuleAlternative>> alternatives;  // of every rule
  std::vector<SweepJob> jobs;
  // In the order of the grid, the last axis changing fastest, alternatives
  // fastest of all.
  std::vector<SweepPoint> points;
};

// What is the same at all points but for the axes.
struct SweepBase {
  std::string problem;  // the specification that the axes add to
  NetworkSettings network;
  int batch_size = -1;  // -1: the problem's own
};

bool MakeSweepPlan(const SweepBase& base,
                   const Grid& grid,
                   SweepPlan* plan,
                   std::string* error);

}  // namespace invgrad

#endif  // BIN_SWEEP_PLAN_H_
