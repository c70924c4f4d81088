// A registered least-squares problem (compare/problem.h) as an estimation: a
// start a seed. Its result is a text, a parameter block a line. Evaluations of
// all residuals are counted; a run is solved if it closes all but a millionth of
// the gap between the start and the known minimum.
#ifndef BIN_ESTIMATE_LEAST_SQUARES_ESTIMATION_H_
#define BIN_ESTIMATE_LEAST_SQUARES_ESTIMATION_H_

#include <memory>
#include <string>
#include <vector>

#include "invgrad/compare/problem.h"
#include "invgrad/minimize.h"
#include "problems/estimation/estimation.h"

namespace invgrad {

// The problem's iterations, and tolerances that end a run when rounding does.
MinimizerOptions LeastSquaresBudget(const LeastSquaresProblem& problem);

// Null, with *error, if the problem has no residual blocks.
std::unique_ptr<Estimation> MakeLeastSquaresEstimation(
    const LeastSquaresProblem& problem,
    const MinimizerOptions& budget,
    const std::vector<int>& seeds,
    std::string* error);

}  // namespace invgrad

#endif  // BIN_ESTIMATE_LEAST_SQUARES_ESTIMATION_H_
