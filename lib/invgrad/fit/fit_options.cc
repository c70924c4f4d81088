#include "invgrad/internal/fit_options.h"

#include <initializer_list>

#include "fmt/core.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/model_decrease.h"

namespace invgrad {

bool FitOptions::IsValid(std::string* error) const {
  struct Item {
    const char* name;
    double value;
    double least;
    bool is_open;  // `least` itself is not allowed
  };
  for (const Item& item : std::initializer_list<Item>{
           {"max_num_iterations", 1.0 * max_num_iterations, 0.0, false},
           {"function_tolerance", function_tolerance, 0.0, false},
           {"gradient_tolerance", gradient_tolerance, 0.0, false},
           {"parameter_tolerance", parameter_tolerance, 0.0, false},
           {"initial_trust_region_radius",
            initial_trust_region_radius,
            0.0,
            true},
           {"rank_threshold", rank_threshold, 1e-12, false},
           {"num_threads", 1.0 * num_threads, 1.0, false}}) {
    const bool is_valid =
        item.is_open ? item.value > item.least : item.value >= item.least;
    if (is_valid && std::isfinite(item.value)) continue;
    *error = fmt::format("{} = {:g} is not {} {:g}, or not finite",
                         item.name,
                         item.value,
                         item.is_open ? "above" : "at least",
                         item.least);
    return false;
  }
  if (rank_threshold >= 1.0) {
    *error =
        fmt::format("rank_threshold = {:g} is not below 1", rank_threshold);
    return false;
  }
  return true;
}

std::string FitStatusText(FitStatus status) {
  switch (status) {
    case FitStatus::kGradientTolerance:
      return "converged: the gradient is below its tolerance";
    case FitStatus::kParameterTolerance:
      return "converged: the step is below its tolerance";
    case FitStatus::kFunctionTolerance:
      return "converged: the change of the cost is below its tolerance";
    case FitStatus::kMinTrustRegionRadius:
      return "converged: the trust region is below its smallest radius";
    case FitStatus::kMaxIterations:
      return "not converged: all iterations used";
    case FitStatus::kInvalidSteps:
      return "not converged: no step decreases the linearized cost";
    case FitStatus::kInvalidJacobian:
      return "not converged: the Jacobian is not finite at a better state";
    case FitStatus::kInvalidStart:
      return "failed: residuals or Jacobian are not finite at the start";
  }
  LOG(FATAL) << "not a status: " << static_cast<int>(status);
  return "";
}

std::string FitRemarks::ToText() const {
  std::string text = FitStatusText(status);
  if (invalid_row >= 0) text += fmt::format(": row {}", invalid_row);
  if (invalid_parameter >= 0) {
    text += fmt::format(", parameter {} = {:.3g} (valid at {:.3g})",
                        invalid_parameter,
                        value,
                        valid_value);
  }
  if (predicted_decrease > 0.0) {
    if (status <= FitStatus::kMinTrustRegionRadius) text = "not " + text;
    text += NoMinimumText(predicted_decrease);
  }
  if (equal_parameter >= 0) {
    text += fmt::format(
        "; parameters {} and {} coincide at {:.3g}, where J loses rank: start "
        "from different values",
        equal_to,
        equal_parameter,
        value);
  }
  return text;
}

}  // namespace invgrad
