#include <cstddef>
#include <string>

#include "fmt/core.h"
#include "invgrad/update_callback.h"

namespace invgrad {
namespace {

using Reason = DomainFailure::Reason;

const char* ReasonText(Reason reason) {
  switch (reason) {
    case Reason::kPlus:
      return "Plus returned false";
    case Reason::kReturned:
      return "cost function returned false";
    case Reason::kResidual:
      return "a residual is not finite";
    case Reason::kCost:
      return "the cost is not finite";
    case Reason::kJacobian:
      break;
  }
  return "the Jacobian is not finite";
}

}  // namespace

std::string DomainFailure::ToText() const {
  constexpr std::size_t kMaxNumParameters = 5;
  std::string text = is_start ? "the start: " : "";
  if (residual_block >= 0) {
    text += fmt::format(
        "residual block {} ({})", residual_block, ReasonText(reason));
    if (fails_at_good_state && !is_start) {
      text += ": the good state lies outside, too";
      if (only_without_jacobians) {
        text += ", if no Jacobians are requested (jacobians = nullptr)";
      }
    }
  }
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (i == kMaxNumParameters) {
      text += fmt::format(" and {} more", parameters.size() - i);
      break;
    }
    const Parameter& parameter = parameters[i];
    if (i > 0) {
      text += ", ";
    } else {
      text += fmt::format("{}parameter ", text.empty() ? "" : ": ");
    }
    text += '`' + parameter.name + '`';
    if (reason == Reason::kPlus) {
      text += fmt::format(" ({})", ReasonText(reason));
    } else if (parameter.component < 0) {
      text += fmt::format(
          " of norm {:.3g} (was {:.3g})", parameter.value, parameter.was);
    } else {
      text += fmt::format("[{}] = {:.3g} ({} {:.3g})",
                          parameter.component,
                          parameter.value,
                          is_start ? "valid at" : "was",
                          parameter.was);
    }
  }
  if (residual_block >= 0 && num_failing_blocks > 1) {
    text += fmt::format("; {} other residual blocks fail, too",
                        num_failing_blocks - 1);
  }
  return text;
}

}  // namespace invgrad
