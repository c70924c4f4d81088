#include "invgrad/ceres/model_function.h"

#include <string>

#include "Eigen/Core"
#include "invgrad/internal/logging.h"

namespace invgrad {

ModelFunction::ModelFunction(const Model* model, const DataSet* data)
    : model_(model), data_(data) {
  CHECK(model != nullptr);
  CHECK(data != nullptr);
}

bool ModelFunction::Evaluate(const double* parameters,
                             double* cost,
                             double* gradient) const {
  Linearization linearization;
  LinearizationParts parts;
  parts.gradient = gradient != nullptr;
  std::string error;
  if (!model_->Linearize(
          Eigen::Map<const Eigen::VectorXd>(parameters, NumParameters()),
          *data_,
          parts,
          &linearization,
          &error)) {
    VLOG(1) << error;  // Evaluate has no message
    return false;
  }
  *cost = linearization.cost;
  if (gradient != nullptr) {
    Eigen::Map<Eigen::VectorXd>(gradient, NumParameters()) =
        linearization.gradient;
  }
  return true;
}

}  // namespace invgrad
