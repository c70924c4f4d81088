#include "invgrad/separable/affine_check.h"

#include <limits>
#include <vector>

#include "Eigen/Core"
#include "fmt/core.h"
#include "invgrad/ceres/residual_evaluation.h"
#include "invgrad/random.h"

namespace invgrad {
namespace {

// The index in the problem of the residual block with this row.
int IndexOfRow(const ComponentResiduals& residuals, Eigen::Index row) {
  int index = -1;
  for (const auto& block : residuals.residual_blocks()) {
    if (block.row <= row) index = block.index;
  }
  return index;
}

}  // namespace

bool CheckAffine(
    const ComponentResiduals& residuals,
    const std::function<std::string(const ComponentResiduals::Parameter&)>&
        name,
    std::string* error) {
  const Eigen::VectorXd c = residuals.Linear();
  const Eigen::VectorXd size = c.cwiseAbs().cwiseMax(1.0);
  const int p = residuals.num_linear();
  const std::vector<const double*> alpha = residuals.Alpha();
  NumpyRandom random(1);
  Eigen::VectorXd c_k[2];
  Eigen::VectorXd r[2];
  Eigen::MatrixXd Phi[2];
  for (int k = 0; k < 2; ++k) {
    const Eigen::ArrayXd u = 2.0 * random.Rand(p, 1).array() - 1.0;
    c_k[k] = c.array() + u * size.array();
    if (!residuals.Evaluate(
            alpha.data(), c_k[k], &r[k], nullptr, &Phi[k], error)) {
      *error += " at random values of the linear parameters";
      return false;
    }
  }
  const Eigen::VectorXd terms =
      (r[0].cwiseAbs() + r[1].cwiseAbs() + Phi[0].cwiseAbs() * size)
          .cwiseMax(std::numeric_limits<double>::min());
  Eigen::Index row;
  Eigen::Index column;
  const double curvature = (terms.cwiseInverse().asDiagonal() *
                            (Phi[1] - Phi[0]) * size.asDiagonal())
                               .cwiseAbs()
                               .maxCoeff(&row, &column);
  if (!(curvature <= kAffineTolerance)) {
    const std::string parameter = name(residuals.linear()[column]);
    *error = ResidualBlockMessage(
        IndexOfRow(residuals, row),
        fmt::format(
            "not affine in the linear parameters: the derivative by {} changes "
            "by {:.2g} of the residual's terms (allowed: {:.0e}); leave {}, or "
            "a parameter that multiplies it, out of the linear ones",
            parameter,
            curvature,
            kAffineTolerance,
            parameter));
    return false;
  }
  const double mismatch = (r[1] - r[0] - Phi[0] * (c_k[1] - c_k[0]))
                              .cwiseQuotient(terms)
                              .cwiseAbs()
                              .maxCoeff(&row);
  if (mismatch <= kAffineTolerance) return true;
  Phi[0].row(row).cwiseProduct(size.transpose()).cwiseAbs().maxCoeff(&column);
  *error = ResidualBlockMessage(
      IndexOfRow(residuals, row),
      fmt::format("its derivative by the linear parameter {} is constant, but "
                  "wrong by {:.2g} of the residual's terms (allowed: {:.0e}); "
                  "correct the cost function's Jacobian",
                  name(residuals.linear()[column]),
                  mismatch,
                  kAffineTolerance));
  return false;
}

}  // namespace invgrad
