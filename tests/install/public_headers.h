// The public headers, in alphabetic order. A new one is added here, and a line
// to docs/changes.md.
#ifndef TESTS_INSTALL_PUBLIC_HEADERS_H_
#define TESTS_INSTALL_PUBLIC_HEADERS_H_

#include <string>
#include <vector>

namespace invgrad {

inline const std::vector<std::string>& PublicHeaders() {
  static const auto& headers = *new std::vector<std::string>{
      "autodiff_loss.h",
      "autodiff_simulator.h",
      "blas_threads.h",
      "compare/compare.h",
      "compare/equation_problem.h",
      "compare/problem.h",
      "compare/sample_data.h",
      "cost.h",
      "covariance.h",
      "data.h",
      "dense_network.h",
      "derivative_set.h",
      "determined_step.h",
      "equation.h",
      "equation_points.h",
      "field_simulator.h",
      "fit.h",
      "fit_global.h",
      "inverse_simulator.h",
      "invgrad.h",
      "jacobian_operator.h",
      "linear_simulator.h",
      "linearization.h",
      "loss.h",
      "method.h",
      "minimize.h",
      "model.h",
      "mpi.h",
      "network.h",
      "npy.h",
      "option_set.h",
      "proposal.h",
      "random.h",
      "rank_report.h",
      "rules.h",
      "second_order_cost_function.h",
      "separable.h",
      "simulator.h",
      "spectral.h",
      "stored_jacobian.h",
      "time_stepping_simulator.h",
      "time_windows.h",
      "to_json.h",
      "torch_network.h",
      "train.h",
      "trial_function.h",
      "update_callback.h",
      "update_rule.h",
      "version.h",
  };
  return headers;
}

}  // namespace invgrad

#endif  // TESTS_INSTALL_PUBLIC_HEADERS_H_
