// The problems that are equations of evolution, for solutions in windows of
// time (time_windows.h).
#ifndef PROBLEMS_EQUATIONS_EVOLUTIONS_H_
#define PROBLEMS_EQUATIONS_EVOLUTIONS_H_

#include <functional>
#include <string>

#include "invgrad/compare/equation_problem.h"
#include "invgrad/time_windows.h"

namespace invgrad {

struct EvolutionProblem {
  double end;  // 0 <= t <= end
  InputFunction start;
  // With solution and box in the window.
  std::function<EquationProblem(const TimeWindow& window)> in_window;
};

// specification: "kdv_pinn:num_t=32", a row of Problems() with its options.
// Returns false, with *error, if it is no equation of evolution or an option is
// not allowed.
bool CreateEvolution(const std::string& specification,
                     EvolutionProblem* evolution,
                     std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_EQUATIONS_EVOLUTIONS_H_
