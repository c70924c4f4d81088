#include "invgrad/internal/model_decrease.h"

#include "fmt/core.h"

namespace invgrad {

std::string NoMinimumText(double decrease) {
  if (decrease == 0.0) return "";
  return fmt::format(
      "; no minimum: the linear model predicts that the cost falls by {:.2g} %",
      100.0 * decrease);
}

}  // namespace invgrad
