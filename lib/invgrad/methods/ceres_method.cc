#include "invgrad/methods/ceres_method.h"

#include "glog/logging.h"

namespace invgrad {

void ConfigureCeres(const Method& method,
                    ceres::Solver::Options* options,
                    ceres::GradientProblemSolver::Options* gradient_options) {
  std::string error;
  CHECK(method.ceres->configure(
      method.ceres_settings, options, gradient_options, &error))
      << error;
}

bool TakesProposals(const Method& method,
                    const ceres::Problem& problem,
                    std::string* error) {
  return method.rule == nullptr ||
         UpdateCallback::IsSupported(UpdateCallback::Options(), problem, error);
}

std::string ProposalsText(const UpdateCallback::Summary& summary) {
  std::string text = "; " + summary.BriefReport();
  if (summary.num_proposed == 0 && !summary.message.empty()) {
    text += " (" + summary.message + ")";
  }
  return text;
}

}  // namespace invgrad
