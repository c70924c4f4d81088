// A function with a current point that an iteration can linearize and move.
//
// Minimize (minimize.h) uses only this interface, for a ceres::Problem
// (problem_linearizer.h) and for a simulator with a loss (minimize.h).
#ifndef INVGRAD_INTERNAL_OBJECTIVE_H_
#define INVGRAD_INTERNAL_OBJECTIVE_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/linearization.h"

namespace invgrad {

class Objective {
 public:
  virtual ~Objective() = default;

  // n: the size of a step, the dimension of the tangent space.
  virtual int num_parameters() const = 0;

  // Linearizes at the current point. Returns false, with *error, if the cost or
  // a requested part cannot be computed or is not finite.
  virtual bool Linearize(const LinearizationParts& parts,
                         Linearization* linearization,
                         std::string* error) const = 0;

  // The cost at the current point.
  virtual bool Cost(double* cost, std::string* error) const = 0;

  // The current point in ambient coordinates.
  virtual Eigen::VectorXd State() const = 0;
  virtual void SetState(const Eigen::VectorXd& state) = 0;

  // Moves the point by a tangent step (n). Returns false, and leaves the point
  // unchanged, if that fails.
  virtual bool Plus(const Eigen::VectorXd& step) = 0;
};

// Moves the objective from its current point, and moves it back; does not own
// it.
LinearizeAfter AfterOf(Objective* objective);

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_OBJECTIVE_H_
