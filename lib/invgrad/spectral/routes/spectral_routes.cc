#include "invgrad/spectral/routes/spectral_routes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "glog/logging.h"
#include "invgrad/core/finite.h"
#include "invgrad/spectral/step_error.h"

namespace invgrad {

using Eigen::VectorXd;

bool GradientRoute(const SpectralProblem& problem,
                   VectorXd* d,
                   SpectralStepSummary* summary) {
  CHECK(problem.filter.IsGradientDescent())
      << "The route gradient only computes phi(s) = s.";
  problem.J.TransposeTimes(problem.g, d);
  summary->estimated_error = RoundingError();
  return d->allFinite() || (CheckJacobianFinite(problem.J, &summary->message) &&
                            CheckFinite("J^T g", *d, &summary->message));
}

double JumpOf(const SpectralFilter& filter) {
  if (filter.tau > 0.0) return filter.clamp ? 0.0 : filter.tau;
  return filter.IsDamped() || filter.kappa < 0.0 ? -1.0 : 0.0;
}

void SummarizeSpectrum(const SpectralFilter& filter,
                       const VectorXd& s,
                       double s_max,
                       int power,
                       double resolution,
                       SpectralStepSummary* summary) {
  summary->s_max = s_max;
  const double jump = JumpOf(filter);
  summary->threshold_resolution =
      jump < 0.0 ? 0.0 : resolution / (power * std::pow(jump, power));
  for (const double value : s) {
    if (filter.Keeps(value, s_max)) {
      summary->s_min_kept =
          summary->rank == 0 ? value : std::min(summary->s_min_kept, value);
      ++summary->rank;
    }
    const double distance =
        std::abs(std::pow(value / s_max, power) - std::pow(jump, power));
    if (jump >= 0.0 && distance <= resolution) ++summary->num_undecided;
  }
}

bool CheckJacobianFinite(const JacobianOperator& J, std::string* message) {
  // A row is finite if its product with tiny numbers is.
  VectorXd product;
  J.Times(VectorXd::Constant(J.cols(), std::numeric_limits<double>::min()),
          &product);
  for (int row = 0; row < product.size(); ++row) {
    if (!std::isfinite(product[row])) {
      *message = "J is not finite: " + J.RowName(row);
      return false;
    }
  }
  return true;
}

}  // namespace invgrad
