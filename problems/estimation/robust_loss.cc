#include "problems/estimation/robust_loss.h"

#include <vector>

#include "invgrad/core/option_set.h"

namespace invgrad {

namespace {

using MakeScaled = ceres::LossFunction* (*)(double scale);

template <typename Loss>
ceres::LossFunction* Make(double scale) {
  return new Loss(scale);
}

struct LossRow {
  std::string name;
  MakeScaled make;
};

const std::vector<LossRow>& Rows() {
  static const auto* const rows = new std::vector<LossRow>{
      {"huber", Make<ceres::HuberLoss>},
      {"soft_l_one", Make<ceres::SoftLOneLoss>},
      {"cauchy", Make<ceres::CauchyLoss>},
      {"arctan", Make<ceres::ArctanLoss>},
      {"tukey", Make<ceres::TukeyLoss>},
  };
  return *rows;
}

}  // namespace

bool ParseRobustLoss(const std::string& text,
                     MakeLossFunction* make_loss,
                     std::string* error) {
  const size_t colon = text.find(':');
  const std::string name = text.substr(0, colon);
  if (name == "none") {
    if (colon != std::string::npos) {
      *error = "none has no scale; allowed: none";
      return false;
    }
    *make_loss = [] { return nullptr; };
    return true;
  }
  double scale = 1.0;
  OptionSet set;
  set.Add("scale", &scale, {0.0, 1e100, /*open_low=*/true}, "");
  if (colon != std::string::npos &&
      !set.Set("scale", text.substr(colon + 1), error)) {
    *error = name + ": " + *error;
    return false;
  }
  std::vector<std::string> names = {"none"};
  for (const LossRow& row : Rows()) {
    if (row.name == name) {
      *make_loss = [make = row.make, scale] { return make(scale); };
      return true;
    }
    names.push_back(row.name);
  }
  *error = "unknown loss '" + name + "'; allowed:";
  for (const std::string& known : names) *error += " " + known;
  return false;
}

}  // namespace invgrad
