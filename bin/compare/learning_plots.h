// The pictures of a learning comparison.
//
//   DIR/loss.png         losses against steps and against seconds; the
//                        problem's metric, if it has one. Of more than eight
//                        methods those that end lowest have colour and name
//   DIR/neurons.png      mean activations of a small network's neurons, a panel
//                        a method, a colour a layer
//   DIR/map.png          x over the input, where both are one number
//   DIR/fields.png       fields of the first test sample (field_plots.h), where
//                        x and y are fields
//   DIR/solution.png     the solution of a differential equation and its error
//                        (field_plots.h)
//   DIR/sample_path.png  the tracked sample in the plane of y_0 and y_1
//   DIR/methods.png      of a small network, three panels a method: the train
//                        loss, the activations' mean and deviation over all
//                        neurons (neuron_statistics.h) and samples, and the
//                        tracked sample
#ifndef BIN_COMPARE_LEARNING_PLOTS_H_
#define BIN_COMPARE_LEARNING_PLOTS_H_

#include <string>
#include <vector>

#include "bin/support/learning_run.h"
#include "bin/support/run_output.h"
#include "invgrad/compare/problem.h"

namespace invgrad {

// `tracked_sample`: -1 if there is none. `initial_weights`: of one of the
// seeds. `runs`: one a method.
std::vector<Picture> LearningPictures(
    const LearningProblem& problem,
    const std::string& directory,
    int tracked_sample,
    const Eigen::VectorXd& initial_weights,
    const std::vector<const LearningRunResult*>& runs);

}  // namespace invgrad

#endif  // BIN_COMPARE_LEARNING_PLOTS_H_
