#include "invgrad/network.h"

#include "invgrad/internal/logging.h"

namespace invgrad {

Eigen::MatrixXd Network::Outputs(const Eigen::VectorXd& weights,
                                 const Eigen::MatrixXd& inputs) const {
  const std::unique_ptr<Pass> pass = NewPass();
  std::string error;
  if (!Forward(weights, inputs, Derivatives::kNone, pass.get(), &error)) {
    LOG(ERROR) << error;
    return {};
  }
  return pass->outputs;
}

}  // namespace invgrad
