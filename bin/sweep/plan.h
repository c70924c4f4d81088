// The plan of a sweep: a grid of settings as one line of text, and its runs.
//
//   num_oscillators=2,4; rule=half_inverse,adam:step_size=1e-3|3e-4; seed=1..3
//
//   grid = axis { ";" axis }
//   axis = name "=" value { "," value }
//
// An axis is `rule`, `seed`, `batch_size`, a setting of the network
// (training_flags.h), an option of the problem, or an option of rules. A value
// of the axis `rule` is a method (method.h); a setting of it may list
// alternatives, separated by "|", and the sweep chooses the best. An option of
// rules applies to every rule that has the option and does not set it; in a
// method with phases, to the last phase. Any other rule runs once, and its
// result counts for all values of the axis. Spaces around names and values are
// ignored.
//
// Fails:   returns false for an unknown axis (with the nearest names), a value
//          that is not allowed, a problem without a network, and a batch larger
//          than the data; *error names axis or value.
#ifndef BIN_SWEEP_PLAN_H_
#define BIN_SWEEP_PLAN_H_

#include <memory>
#include <string>
#include <vector>

#include "bin/support/training_flags.h"
#include "invgrad/compare/problem.h"
#include "invgrad/method.h"

namespace invgrad {

struct GridAxis {
  std::string name;
  std::vector<std::string> values;  // at least one, none twice
};

struct Grid {
  std::vector<GridAxis> axes;  // at least one, no name twice

  // The number of the axis; -1 if there is none.
  int Find(const std::string& name) const;
};

bool ParseGrid(const std::string& text, Grid* grid, std::string* error);

// One choice for each setting of a rule that lists alternatives.
struct RuleAlternative {
  std::string specification;  // "adam:step_size=1e-3"
  std::string chosen;         // "step_size=1e-3"; several joined by ":"
  // Settings whose choice is the smallest or the largest of at least two
  // numbers: the best choice may lie beyond them.
  std::vector<std::string> at_edge;
};

// A value of the axis `rule` with all its alternatives, the last setting
// changing fastest. Does not check the settings.
std::vector<RuleAlternative> ExpandRule(const std::string& rule);

// True if all of the text is a finite number.
bool ParseFinite(const std::string& text, double* number);

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
