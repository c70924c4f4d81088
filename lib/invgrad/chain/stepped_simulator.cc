#include "invgrad/chain/stepped_simulator.h"

#include <utility>

#include "glog/logging.h"
#include "invgrad/core/scratch.h"

namespace invgrad {

SteppedSimulator::SteppedSimulator(RollOut states)
    : states_(std::move(states)) {
  CHECK_EQ(states_.output_size(), 0);
}

bool SteppedSimulator::Advance(const double* state,
                               const double* control,
                               double* next_state) const {
  return states_.step().Evaluate(0, state, control, next_state) &&
         AllFinite(next_state, state_size());
}

bool SteppedSimulator::StepJacobians(const double* x,
                                     const double* start,
                                     double* M) const {
  Scratch<double> state(state_size());
  return states_.Linearize(x, start, state.data(), nullptr, nullptr, M);
}

}  // namespace invgrad
