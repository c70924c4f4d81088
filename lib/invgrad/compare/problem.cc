#include "invgrad/compare/problem.h"

#include "invgrad/minimize.h"

namespace invgrad {

PointObjective PointProblem::MakeObjective() const {
  return PointObjective(simulator, loss, target, start);
}

}  // namespace invgrad
