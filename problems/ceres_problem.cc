#include "problems/ceres_problem.h"

#include <utility>

#include "invgrad/minimize.h"
#include "invgrad/random.h"
#include "problems/problems.h"

namespace invgrad {

bool CreateCeresProblem(const std::string& specification,
                        const ModelBlockOptions& options,
                        CeresProblem* problem,
                        std::string* error) {
  PhysicsProblem physics;
  if (!CreateProblem(specification, nullptr, &physics, error)) return false;
  CeresProblem made;
  if (physics.point.has_value()) {
    const PointObjective objective = physics.point->MakeObjective();
    made.model = std::make_shared<Model>(objective.model());
    made.inverse = physics.point->inverse;
    made.data = objective.data();
    made.unknowns = std::make_unique<Eigen::VectorXd>(objective.State());
  } else if (physics.least_squares.has_value()) {
    *error = specification + " has no model: it is a ceres::Problem already";
    return false;
  } else {
    const LearningProblem& learning = *physics.learning;
    NumpyRandom random(0);
    made.model = learning.model;
    made.inverse = learning.inverse;
    made.data = learning.train;
    made.unknowns = std::make_unique<Eigen::VectorXd>(
        learning.model->network().InitialWeights(learning.initialization,
                                                 &random));
  }
  if (!made.model->loss().SquaredNormFactor().has_value()) {
    *error = specification +
             ": its loss is not a squared norm, and a ceres::Problem is a sum "
             "of squares";
    return false;
  }
  made.problem = std::make_unique<ceres::Problem>();
  AddModelToProblem(*made.model,
                    made.data,
                    made.unknowns->data(),
                    made.problem.get(),
                    options);
  *problem = std::move(made);
  return true;
}

}  // namespace invgrad
