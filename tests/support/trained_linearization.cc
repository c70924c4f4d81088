#include "tests/support/trained_linearization.h"

#include "invgrad/random.h"
#include "invgrad/train.h"

namespace invgrad {

bool LinearizeAfterTraining(const LearningProblem& problem,
                            int batch_size,
                            int num_steps,
                            Linearization* linearization,
                            std::string* error) {
  const Model& model = *problem.model;
  if (batch_size == 0) batch_size = problem.batch_size;
  if (batch_size == 0) batch_size = problem.train.num_samples();
  NumpyRandom random(0);
  TrainOptions options;
  options.initial_weights =
      model.network().InitialWeights(problem.initialization, &random);
  options.batch_size = batch_size;
  options.max_num_steps = num_steps;
  const TrainResult trained =
      Train(model, problem.train, "adam:step_size=1e-3", options);
  *error = trained.error;
  if (!error->empty()) return false;
  if (trained.summary.termination_type == ceres::FAILURE) {
    *error = trained.summary.message;
    return false;
  }
  LinearizationParts parts;
  parts.jacobian = true;
  return model.Linearize(trained.weights,
                         problem.train.Range(0, batch_size),
                         parts,
                         linearization,
                         error);
}

}  // namespace invgrad
