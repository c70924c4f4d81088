#include "bin/compare/least_squares_comparison.h"

#include <utility>

#include "bin/estimate/estimation_comparison.h"
#include "bin/estimate/least_squares_estimation.h"
#include "bin/support/program.h"
#include "bin/support/ranks.h"

namespace invgrad {
namespace {

bool Check(CompareOptions* options,
           const LeastSquaresProblem& problem,
           EstimationOptions* estimation,
           std::vector<EstimationInput>* inputs,
           std::string* error) {
  std::vector<int> seeds;
  if (!CheckNoTraining(/*takes_threads=*/true, error) ||
      !CheckNotGiven({"blas_threads"},
                     "needs a problem with a network: --threads are those of "
                     "Ceres, and of BLAS",
                     error) ||
      !NameFlag("seeds", ParseSeeds(options->seeds, &seeds, error), error) ||
      !NameFlag("levels",
                ParseNumbers(options->levels, &estimation->levels, error),
                error)) {
    return false;
  }
  estimation->threads = options->training.threads;
  estimation->resume = options->resume;
  MinimizerOptions budget = LeastSquaresBudget(problem);
  options->training.SetBudget(&budget);
  options->training.steps = budget.max_num_iterations;  // for flags.txt
  EstimationInput input;
  input.name = options->problem.substr(0, options->problem.find(':'));
  input.estimation = MakeLeastSquaresEstimation(problem, budget, seeds, error);
  if (!NameFlag("problem", input.estimation != nullptr, error)) return false;
  inputs->push_back(std::move(input));
  return true;
}

}  // namespace

bool CompareLeastSquares(CompareOptions* options,
                         const LeastSquaresProblem& problem,
                         const std::vector<Method>& methods,
                         RunCounts* counts,
                         std::string* error) {
  EstimationOptions estimation;
  std::vector<EstimationInput> inputs;
  return AgreeOnRanks(Check(options, problem, &estimation, &inputs, error),
                      error) &&
         CompareEstimations(estimation, inputs, methods, counts, error);
}

}  // namespace invgrad
