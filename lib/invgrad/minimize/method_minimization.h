// Minimizes a simulator and a loss over the simulator's input by a method
// (methods/method.h).
#ifndef INVGRAD_MINIMIZE_METHOD_MINIMIZATION_H_
#define INVGRAD_MINIMIZE_METHOD_MINIMIZATION_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/inverse/inverse_simulator.h"
#include "invgrad/methods/method.h"
#include "invgrad/minimize/chain_objective.h"
#include "invgrad/minimize/minimizer.h"

namespace invgrad {

// Minimizes from the objective's current point; `path` receives the points from
// the start to the final one. `inverse`: the simulator's inverse, or null.
// Returns false if the method does not support the objective, or has phases.
bool MinimizeByMethod(const Method& method,
                      const MinimizerOptions& options,
                      std::shared_ptr<const InverseSimulator> inverse,
                      ChainObjective* objective,
                      std::vector<Eigen::VectorXd>* path,
                      MinimizerSummary* summary,
                      std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_MINIMIZE_METHOD_MINIMIZATION_H_
