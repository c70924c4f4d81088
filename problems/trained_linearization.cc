#include "problems/trained_linearization.h"

#include <memory>

#include "invgrad/io/numpy_random.h"
#include "invgrad/rules/rules.h"
#include "invgrad/train/trainer.h"

namespace invgrad {

bool LinearizeAfterTraining(const LearningProblem& problem,
                            int batch_size,
                            int num_steps,
                            Linearization* linearization,
                            std::string* error) {
  const Model& model = *problem.model;
  if (batch_size == 0) batch_size = problem.batch_size;
  NumpyRandom random(0);
  Eigen::VectorXd weights =
      model.network().InitialWeights(problem.initialization, &random);
  const std::unique_ptr<UpdateRule> adam = MakeRule("adam:step_size=1e-3");
  TrainOptions options;
  options.batch_size = batch_size;
  options.max_num_steps = num_steps;
  History history;
  TrainSummary summary;
  if (!Train(options,
             model,
             problem.train,
             problem.test.Range(0, 0),
             adam.get(),
             &weights,
             &history,
             &summary,
             error)) {
    return false;
  }
  if (summary.termination_type == ceres::FAILURE) {
    *error = summary.message;
    return false;
  }
  LinearizationParts parts;
  parts.jacobian = true;
  return model.Linearize(
      weights, problem.train.Range(0, batch_size), parts, linearization, error);
}

}  // namespace invgrad
