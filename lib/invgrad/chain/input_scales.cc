#include <cmath>

#include "Eigen/Core"
#include "invgrad/dense_network.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

// Differences below this share of the largest value count as rounding.
constexpr double kConstantInput = 1e-12;

}  // namespace

InputScales InputScales::Of(const Eigen::MatrixXd& inputs) {
  CHECK_GT(inputs.cols(), 0) << "there are no samples";
  InputScales scales;
  scales.mean = inputs.rowwise().mean();
  scales.deviation = (inputs.colwise() - scales.mean).rowwise().norm() /
                     std::sqrt(static_cast<double>(inputs.cols()));
  for (Eigen::Index i = 0; i < inputs.rows(); ++i) {
    const auto input = inputs.row(i);
    const double largest = input.cwiseAbs().maxCoeff();
    if (!(input.maxCoeff() - input.minCoeff() > kConstantInput * largest)) {
      scales.deviation[i] = 1.0;
    }
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
