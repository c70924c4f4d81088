// The bounds of a problem's parameter blocks, and the projection onto them that
// Ceres applies after each Plus.
//
//   x <- min(max(x, lower), upper)      entry by entry, in ambient coordinates
#ifndef INVGRAD_CERES_BOUNDS_H_
#define INVGRAD_CERES_BOUNDS_H_

#include <string>

#include "Eigen/Core"
#include "ceres/problem.h"
#include "invgrad/ceres/problem_structure.h"

namespace invgrad {

class Bounds {
 public:
  Bounds(const ceres::Problem& problem, const ProblemStructure& structure);

  // Whether a block that is not constant has a bound.
  bool any() const { return lower_.size() > 0; }
  // `state` as ProblemStructure::State.
  void Project(Eigen::VectorXd* state) const;

 private:
  // As the state; empty: no bounds.
  Eigen::VectorXd lower_;
  Eigen::VectorXd upper_;
};

// Whether the steps of a rule, after which nothing projects, may be taken. False,
// with *error, if a block that is not constant has a bound.
bool IsWithoutBounds(const ceres::Problem& problem,
                     const ProblemStructure& structure,
                     std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_CERES_BOUNDS_H_
