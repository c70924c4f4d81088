#include "invgrad/chain/weights_network.h"

#include "fmt/core.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::MatrixXd;
using Eigen::VectorXd;

std::string WeightsNetwork::Name() const {
  return fmt::format("{} weights that are the outputs", num_weights_);
}

VectorXd WeightsNetwork::InitialWeights(Initialization /*initialization*/,
                                        NumpyRandom* /*random*/) const {
  return VectorXd::Zero(num_weights_);
}

bool WeightsNetwork::Forward(const VectorXd& weights,
                             const MatrixXd& inputs,
                             Derivatives /*derivatives*/,
                             Pass* pass,
                             std::string* /*error*/) const {
  CHECK_EQ(weights.size(), num_weights_);
  CHECK_EQ(inputs.rows(), 0);
  pass->outputs = weights.replicate(1, inputs.cols());
  return true;
}

void WeightsNetwork::Backward(const VectorXd& /*weights*/,
                              const Pass& pass,
                              const MatrixXd& output_covectors,
                              VectorXd* gradient) const {
  CHECK_EQ(output_covectors.cols(), pass.num_columns());
  *gradient = output_covectors.rowwise().sum();
}

void WeightsNetwork::Tangent(const VectorXd& /*weights*/,
                             const Pass& pass,
                             const VectorXd& weight_tangent,
                             MatrixXd* output_tangents) const {
  *output_tangents = weight_tangent.replicate(1, pass.num_columns());
}

}  // namespace invgrad
