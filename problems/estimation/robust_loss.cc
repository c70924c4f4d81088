#include "problems/estimation/robust_loss.h"

#include <utility>

#include "fmt/core.h"
#include "invgrad/core/specification.h"
#include "invgrad/option_set.h"

namespace invgrad {

namespace {

template <typename Loss>
ceres::LossFunction* Make(double scale) {
  return new Loss(scale);
}

using MakeScaled = ceres::LossFunction* (*)(double scale);
constexpr std::pair<const char*, MakeScaled> kLosses[] = {
    {"none", [](double) -> ceres::LossFunction* { return nullptr; }},
    {"huber", Make<ceres::HuberLoss>},
    {"soft_l_one", Make<ceres::SoftLOneLoss>},
    {"cauchy", Make<ceres::CauchyLoss>},
    {"arctan", Make<ceres::ArctanLoss>},
    {"tukey", Make<ceres::TukeyLoss>},
};

}  // namespace

bool ParseRobustLoss(const std::string& text,
                     MakeLossFunction* make_loss,
                     std::string* error) {
  const size_t colon = text.find(':');
  const std::string name = text.substr(0, colon);
  double scale = 1.0;
  if (colon != std::string::npos) {
    if (name == "none") {
      *error = "none has no scale; allowed: none";
      return false;
    }
    OptionSet set;
    set.Add("scale", &scale, {0.0, 1e100, /*open_low=*/true}, "");
    if (!set.Set("scale", text.substr(colon + 1), error)) {
      *error = name + ": " + *error;
      return false;
    }
  }
  std::string names;
  for (const auto& [known, make] : kLosses) {
    if (known == name) {
      *make_loss = [make = make, scale] { return make(scale); };
      return true;
    }
    names += fmt::format(" {}", known);
  }
  *error = fmt::format("unknown loss '{}'; allowed:{}", Printable(name), names);
  return false;
}

}  // namespace invgrad
