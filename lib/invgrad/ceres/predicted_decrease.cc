#include "invgrad/ceres/predicted_decrease.h"

#include <utility>

#include "Eigen/Core"
#include "invgrad/internal/model_decrease.h"
#include "invgrad/internal/qr.h"

namespace invgrad {

double PredictedDecrease(double function_tolerance,
                         double parameter_tolerance,
                         bool has_bounds,
                         const ProblemLinearizer& linearizer) {
  constexpr int kMaxNumParameters = 50;
  constexpr double kMaxEntries = 4e7;  // 320 MB
  const ProblemStructure& structure = linearizer.structure();
  const int n = structure.num_parameters;
  if (has_bounds || n == 0 || n > kMaxNumParameters ||
      structure.num_variable_residuals <= n ||
      static_cast<double>(structure.num_residuals) * n > kMaxEntries) {
    return 0.0;
  }
  Linearization at_x;
  std::string ignored;
  if (!linearizer.Linearize(LinearizationParts::Jacobian(), &at_x, &ignored)) {
    return 0.0;
  }
  Eigen::MatrixXd J;
  at_x.jacobian->ToDense(&J);
  const Eigen::VectorXd& r = at_x.loss_gradient;
  const double squared_norm = r.squaredNorm();
  if (!(squared_norm > 0.0)) return 0.0;
  const ThinQr qr(std::move(J));
  Eigen::VectorXd x(n);
  for (const auto& block : structure.parameter_blocks) {
    x.segment(block.column, block.tangent_size)
        .setConstant(
            Eigen::Map<const Eigen::VectorXd>(block.values, block.ambient_size)
                .norm());
  }
  return RelativeModelDecrease<Eigen::MatrixXd, Eigen::VectorXd>(
      function_tolerance,
      parameter_tolerance,
      qr.R,
      qr.Q.transpose() * r,
      x,
      squared_norm);
}

}  // namespace invgrad
