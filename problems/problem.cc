#include "problems/problem.h"

#include "invgrad/minimize/chain_objective.h"

namespace invgrad {

ChainObjective PointProblem::MakeObjective() const {
  return ChainObjective(simulator, loss, target, start);
}

}  // namespace invgrad
