// The plan of a sweep: a grid of settings (grid.h), and its runs.
//
// An axis is `rule`, `seed`, an option of the problem, an option of rules, or,
// of a problem with a network, `batch_size` or a setting of the network
// (training_flags.h). Of the alternatives of a rule's setting the sweep chooses
// the best. An option of rules applies to every rule that has the option and
// does not set it; in a method with phases, to the last phase. Any other rule
// runs once, and its result counts for all values of the axis.
//
// Fails:   returns false for an unknown axis (with the nearest names), a value
//          that is not allowed, a method that does not fit, and a batch larger
//          than the data; *error names axis or value.
#ifndef BIN_SWEEP_PLAN_H_
#define BIN_SWEEP_PLAN_H_

#include <memory>
#include <string>
#include <vector>

#include "bin/support/training_flags.h"
#include "bin/sweep/grid.h"
#include "invgrad/compare/problem.h"
#include "invgrad/method.h"

namespace invgrad {

// One run.
struct SweepJob {
  std::string name;  // of its directory
  std::shared_ptr<const PhysicsProblem> problem;
  Method method;
  // In training: at least 1; of a method that has none of its own.
  int batch_size = 0;
  int seed = 0;

  bool is_training() const { return problem->learning.has_value(); }
  const LearningProblem& learning() const { return *problem->learning; }
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

// Settings of all points, unless an axis replaces them.
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
