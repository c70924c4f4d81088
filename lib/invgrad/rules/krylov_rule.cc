#include "invgrad/rules/krylov_rule.h"

#include <algorithm>
#include <sstream>

#include "glog/logging.h"

namespace invgrad {

void KrylovRule::Options::Describe(OptionSet* set) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  step_size.Describe(/*allow_auto=*/true, set);
  set->Add("kappa",
           &filter.kappa,
           {-1.0, 1.0},
           "exponent: -1 gradient, 1/2 half-inverse, 1 Gauss-Newton");
  set->Add("iterations",
           &iterations,
           {1.0, 1e5},
           "k: products with J and with J^T for a step, at most");
  set->Add("truncation",
           &filter.tau,
           {0.0, 1.0, false, true},
           "tau: singular values s <= tau s_max are dropped");
  set->Add("tolerance",
           &tolerance,
           {0.0, kInfinity, true},
           "estimated relative error at which a truncated step is done");
}

KrylovRule::KrylovRule(const Options& options) : options_(options) {
  CheckOptions(options);
}

LinearizationParts KrylovRule::Needs() const {
  LinearizationParts parts;
  parts.jacobian = true;
  return parts;
}

std::vector<MemoryPart> KrylovRule::StepMemory(const JacobianSizes& J) const {
  const double size = std::min(J.rows, J.cols);
  const double num_vectors = std::min<double>(options_.iterations, size);
  std::vector<MemoryPart> parts = UpdateRule::StepMemory(J);
  parts.push_back({"Krylov basis", sizeof(double) * num_vectors * size});
  return parts;
}

bool KrylovRule::ComputeStep(const Linearization& at_x,
                             Eigen::VectorXd* step,
                             std::string* error) {
  CHECK(at_x.jacobian != nullptr) << "A joint rule needs J.";
  report_.clear();
  GolubKahanOptions golub_kahan;
  golub_kahan.tolerance = options_.tolerance;
  golub_kahan.max_iterations = options_.iterations;
  golub_kahan.always_one_basis = true;
  GolubKahanSummary summary;
  Eigen::VectorXd direction;
  if (!GolubKahanStep(*at_x.jacobian,
                      at_x.loss_gradient,
                      options_.filter,
                      golub_kahan,
                      &workspace_,
                      &direction,
                      &summary)) {
    *error = summary.message;
    return false;
  }
  double eta = 0.0;
  if (!ScaleToStep(options_.step_size, at_x, -direction, &eta, step, error)) {
    return false;
  }
  std::ostringstream report;
  report.precision(2);
  report << summary.num_iterations << " iterations";
  if (summary.s_max > 0.0) {
    report << ", " << summary.rank << " values down to "
           << summary.s_min_kept / summary.s_max << " s_max";
  }
  if (options_.step_size.is_auto()) report << ", step size " << eta;
  report_ = report.str();
  return true;
}

}  // namespace invgrad
