// A fit with few parameters as JSON (to_json.h).
//
//   std::vector<FitResult<3>> fits;
//   nlohmann::ordered_json json = fits;  // an array
//   file << JsonText(json);
//
// docs/json.md lists the members.
#ifndef INVGRAD_JSON_FIT_TO_JSON_H_
#define INVGRAD_JSON_FIT_TO_JSON_H_

#include <array>
#include <vector>

#include "invgrad/fit.h"
#include "invgrad/to_json.h"
#include "nlohmann/json.hpp"

namespace invgrad {

// The name is nlohmann-json's.
template <int N>
void to_json(nlohmann::ordered_json& json, const FitResult<N>& fit) {
  std::array<double, N> x;
  std::array<double, N> standard_errors;
  std::array<double, N> undetermined_shares;
  std::array<std::array<double, N>, N> covariance;
  for (int i = 0; i < N; ++i) {
    x[i] = fit.x[i];
    standard_errors[i] = fit.StandardError(i);
    undetermined_shares[i] = fit.undetermined[i];
    for (int j = 0; j < N; ++j) covariance[i][j] = fit.covariance(i, j);
  }
  json = {{"schema", JsonSchema("fit")},
          {"status", FitStatusText(fit.status)},
          {"is_converged", fit.IsConverged()},
          {"initial_cost", fit.initial_cost},
          {"cost", fit.cost},
          {"num_iterations", fit.num_iterations},
          {"num_rows", fit.num_rows},
          {"x", x},
          {"standard_errors", standard_errors},
          {"undetermined_shares", undetermined_shares},
          {"rank", fit.rank},
          {"residual_variance", fit.residual_variance},
          {"covariance", covariance}};
}

}  // namespace invgrad

#endif  // INVGRAD_JSON_FIT_TO_JSON_H_
