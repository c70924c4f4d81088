#include <cmath>

#include "Eigen/Core"
#include "invgrad/dense_network.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

InputScales InputScales::Of(const Eigen::MatrixXd& inputs) {
  CHECK_GT(inputs.cols(), 0) << "there are no samples";
  InputScales scales;
  scales.mean = inputs.rowwise().mean();
  scales.deviation = (inputs.colwise() - scales.mean).rowwise().norm() /
                     std::sqrt(static_cast<double>(inputs.cols()));
  for (double& deviation : scales.deviation) {
    if (!(deviation > 0.0)) deviation = 1.0;
  }
  return scales;
}

Eigen::MatrixXd InputScales::Apply(const Eigen::MatrixXd& inputs) const {
  CHECK_EQ(inputs.rows(), mean.size());
  return deviation.cwiseInverse().asDiagonal() * (inputs.colwise() - mean);
}

Eigen::VectorXd InputScales::Unscaled(const DenseNetwork& network,
                                      const Eigen::VectorXd& weights) const {
  CHECK_EQ(network.num_inputs(), mean.size());
  CHECK_EQ(network.num_weights(), weights.size());
  Eigen::VectorXd result = weights;
  // A column a unit: its incoming weights, then its bias.
  Eigen::Map<Eigen::MatrixXd> first(
      result.data(), mean.size() + 1, network.widths()[1]);
  for (auto unit : first.colwise()) {
    auto incoming = unit.head(mean.size());
    incoming = incoming.cwiseQuotient(deviation).eval();
    unit[mean.size()] -= incoming.dot(mean);
  }
  return result;
}

}  // namespace invgrad
