#include "invgrad/core/equilibration.h"

#include <cmath>

namespace invgrad {

Eigen::VectorXd EquilibrationOf(const Eigen::MatrixXd& H) {
  constexpr int kNumPasses = 12;
  Eigen::VectorXd d = Eigen::VectorXd::Ones(H.rows());
  Eigen::MatrixXd scaled = H;
  for (int pass = 0; pass < kNumPasses; ++pass) {
    Eigen::VectorXd factor = scaled.cwiseAbs().rowwise().maxCoeff();
    for (double& value : factor) {
      value = value == 0.0 ? 1.0 : 1.0 / std::sqrt(value);
    }
    scaled = factor.asDiagonal() * scaled * factor.asDiagonal();
    d = d.cwiseProduct(factor);
  }
  for (double& value : d) value = std::exp2(std::round(std::log2(value)));
  return d;
}

}  // namespace invgrad
