#include "invgrad/minimize/pull_back_rule.h"

#include "invgrad/core/linearization.h"

namespace invgrad {

bool PullBackRule::ComputeStep(const Linearization& /*at_x*/,
                               Eigen::VectorXd* step,
                               std::string* error) {
  Linearization proxy;
  return pull_back_.Linearize(weights_, data_, rule_.Needs(), &proxy, error) &&
         rule_.ComputeStep(proxy, step, error);
}

}  // namespace invgrad
