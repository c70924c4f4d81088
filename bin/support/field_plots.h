// Pictures of fields on a grid.
#ifndef BIN_SUPPORT_FIELD_PLOTS_H_
#define BIN_SUPPORT_FIELD_PLOTS_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "bin/support/learning_run.h"
#include "bin/support/run_output.h"
#include "invgrad/compare/problem.h"
#include "report/plot.h"

namespace invgrad {

// A field of `rows` rows, row by row, in colours from the least to the greatest
// value of `reference`.
Plot FieldPlot(const std::string& title,
               int rows,
               const Eigen::VectorXd& field,
               const Eigen::VectorXd& reference);

// Whether the network's inputs and the simulator's x and y are fields on one
// grid.
bool HasFields(const LearningProblem& problem);

// The fields of the first test sample: the network's input, unless it is y*; y*
// and x*; then P(x) and x of `initial_weights` and of at most six runs, from
// the lowest metric or, without one, the lowest loss.
Picture FieldsPicture(const LearningProblem& problem,
                      const std::string& path_png,
                      const Eigen::VectorXd& initial_weights,
                      const std::vector<const LearningRunResult*>& runs);

// Adds the panel of a function of two coordinates, `rows` rows, row by row, in
// the colours of `truth`, and the panel of its error. Null: the function is the
// true one.
void AddFunctionPanels(const std::string& title,
                       int rows,
                       const Eigen::VectorXd& function,
                       const Eigen::VectorXd* truth,
                       Picture* picture);

// A function of two coordinates (problem.function_on_grid): the true one, then
// the function and its error of at most six runs, chosen in the same way.
Picture FunctionPicture(const LearningProblem& problem,
                        const std::string& path_png,
                        const std::vector<const LearningRunResult*>& runs);

}  // namespace invgrad

#endif  // BIN_SUPPORT_FIELD_PLOTS_H_
