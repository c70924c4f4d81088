#include "invgrad/rules/krylov_rule.h"

#include <algorithm>
#include <limits>
#include <optional>

#include "fmt/core.h"

namespace invgrad {

KrylovRule::Options::Options() {
  step_size.step_size = std::nullopt;  // auto
  filter = SpectralFilter::HalfInverse(0.0);
}

void KrylovRule::Options::Describe(OptionSet* set) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  DescribeJoint(set);
  set->Add("iterations",
           &iterations,
           {1.0, 1e5},
           "k: products with J and with J^T for a step, at most");
  set->Add("tolerance",
           &tolerance,
           {0.0, kInfinity, true},
           "estimated relative error at which a truncated step is done");
}

KrylovRule::KrylovRule(const Options& options) : JointRule(options) {
  CheckOptions(options);
  golub_kahan_options_.tolerance = options.tolerance;
  golub_kahan_options_.max_iterations = options.iterations;
}

std::vector<MemoryPart> KrylovRule::StepMemory(const JacobianSizes& J) const {
  const double size = std::min(J.rows, J.cols);
  const double num_vectors =
      std::min<double>(golub_kahan_options_.max_iterations, size);
  std::vector<MemoryPart> parts = UpdateRule::StepMemory(J);
  parts.push_back({"Krylov basis", sizeof(double) * num_vectors * size});
  return parts;
}

bool KrylovRule::ComputeDirection(const Linearization& at_x,
                                  const SpectralFilter& filter,
                                  Eigen::VectorXd* direction,
                                  std::string* report,
                                  std::string* error) {
  GolubKahanSummary summary;
  if (!GolubKahanStep(*at_x.jacobian,
                      at_x.loss_gradient,
                      filter,
                      golub_kahan_options_,
                      &basis_,
                      direction,
                      &summary)) {
    *error = summary.message;
    return false;
  }
  *report = fmt::format("{} iterations", summary.num_iterations);
  if (summary.s_max > 0.0) {
    *report += fmt::format(", {} values down to {:.2g} s_max",
                           summary.rank,
                           summary.s_min_kept / summary.s_max);
  }
  return true;
}

}  // namespace invgrad
