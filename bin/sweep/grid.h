// The grid of a sweep as one line of text.
//
//   num_oscillators=2,4; rule=half_inverse,adam:step_size=1e-3|3e-4; seed=1..3
//
//   grid = axis { ";" axis }
//   axis = name "=" value { "," value }
//
// A value of the axis `rule` is a method (method.h); a setting of it may list
// alternatives, separated by "|". Spaces around names and values are ignored.
#ifndef BIN_SWEEP_GRID_H_
#define BIN_SWEEP_GRID_H_

#include <string>
#include <vector>

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

}  // namespace invgrad

#endif  // BIN_SWEEP_GRID_H_
