#include "bin/estimate/way.h"

#include "invgrad/method.h"
#include "invgrad/minimize/method_minimization.h"
#include "invgrad/separable.h"

namespace invgrad {

std::vector<Way> Ways(const std::vector<Method>& methods,
                      const std::string& separable) {
  std::vector<Way> ways;
  for (const Method& method : methods) {
    if (separable != "on") ways.push_back({method, false, method.label});
    if (separable != "off") {
      ways.push_back({method, true, method.label + " separable"});
    }
  }
  return ways;
}

bool MinimizeByWay(const Way& way,
                   const MinimizerOptions& options,
                   Estimation* estimation,
                   ceres::Problem* problem,
                   MinimizerSummary* summary,
                   std::string* error) {
  if (!way.is_separable) {
    return MinimizeProblem(way.method,
                           options,
                           estimation->MakeOrdering(),
                           problem,
                           summary,
                           error);
  }
  const std::vector<LinearBlock> linear = estimation->LinearParameters();
  if (linear.empty()) {
    *error = "no parameter is proved to be linear; use --separable=off";
    return false;
  }
  SeparableProblem::Options separable_options;
  separable_options.block_name = options.block_name;
  const auto separable =
      SeparableProblem::Create(separable_options, linear, problem, error);
  if (separable == nullptr || !MinimizeProblem(way.method,
                                               options,
                                               /*elimination_order=*/nullptr,
                                               separable->reduced(),
                                               summary,
                                               error)) {
    return false;
  }
  std::string why;
  if (!separable->SolveLinear(&why)) {
    summary->termination_type = ceres::FAILURE;
    summary->message = why;
  }
  return true;
}

}  // namespace invgrad
