// Converts reports and fits to JSON, for other programs. Needs nlohmann-json.
//
//   nlohmann::ordered_json json = report;
//   file << JsonText(json);
//   {"schema": {"name": "invgrad.rank_report", "version": 1}, "cost": 0.5, ...}
//
// The members have the names of the C++ members, in their order, after
// "schema". A fit has status as its StatusText(), undetermined as
// "undetermined_shares", and what its functions return. docs/json.md lists all
// members, with types and units. Members may be added to a version; those that
// it has keep their names and meanings.
//
// Numbers:  the shortest decimal number that reads back as the same double. A
//           number that is not finite (an infinite standard deviation, NaN) is
//           null in the text.
// Names:    UTF-8; other bytes become U+FFFD in the text.
// Missing:  a std::optional without value is null.
// Matrices: an array of rows.
// Blocks:   their indices in "blocks".
//
// Source: RFC 8259; nlohmann-json, which finds these functions by their name.
#ifndef INVGRAD_TO_JSON_H_
#define INVGRAD_TO_JSON_H_

#include <array>
#include <string>
#include <vector>

#include "invgrad/covariance.h"
#include "invgrad/internal/fit_options.h"
#include "invgrad/minimize.h"
#include "invgrad/rank_report.h"
#include "invgrad/update_callback.h"
#include "nlohmann/json.hpp"
#include "nlohmann/json_fwd.hpp"

namespace invgrad {

// The name is nlohmann-json's.
void to_json(nlohmann::ordered_json& json, const RankReport& report);
void to_json(nlohmann::ordered_json& json, const Covariance& covariance);
void to_json(nlohmann::ordered_json& json, const DomainFailure& failure);
void to_json(nlohmann::ordered_json& json,
             const UpdateCallback::Summary& summary);
void to_json(nlohmann::ordered_json& json, const MinimizerSummary& summary);

// {"name": "invgrad.NAME", "version": 1}
nlohmann::ordered_json JsonSchema(const std::string& name);

// The text of a file, on one line: reports of large problems are large.
std::string JsonText(const nlohmann::ordered_json& json);

// A fit with few parameters (fit.h).
//
//   std::vector<FitResult<3>> fits;
//   nlohmann::ordered_json json = fits;  // an array
//   file << JsonText(json);
//
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
          {"status", fit.StatusText()},
          {"is_converged", fit.IsConverged()},
          {"initial_cost", fit.initial_cost},
          {"cost", fit.cost},
          {"invalid_row", fit.invalid_row},
          {"invalid_parameter", fit.invalid_parameter},
          {"valid_value", fit.valid_value},
          {"num_iterations", fit.num_iterations},
          {"num_rows", fit.num_rows},
          {"x", x},
          {"standard_errors", standard_errors},
          {"undetermined_shares", undetermined_shares},
          {"rank", fit.rank},
          {"predicted_decrease", fit.predicted_decrease},
          {"equal_parameter", fit.equal_parameter},
          {"equal_to", fit.equal_to},
          {"residual_variance", fit.residual_variance},
          {"covariance", covariance}};
}

}  // namespace invgrad

#endif  // INVGRAD_TO_JSON_H_
