#include "invgrad/internal/objective.h"

#include "invgrad/internal/logging.h"

namespace invgrad {

LinearizeAfter AfterOf(Objective* objective) {
  return [objective](const Eigen::VectorXd& step,
                     const LinearizationParts& parts,
                     Linearization* after,
                     std::string* error) {
    CHECK_EQ(step.size(), objective->num_parameters());
    const Eigen::VectorXd state = objective->State();
    if (!objective->Plus(step)) {
      *error = "the point cannot be moved by the step";
      return false;
    }
    const bool has_value = objective->Linearize(parts, after, error);
    objective->SetState(state);
    return has_value;
  };
}

}  // namespace invgrad
