#include "invgrad/rules/spectral_rule.h"

#include <algorithm>
#include <limits>
#include <sstream>
#include <vector>

#include "glog/logging.h"

namespace invgrad {
namespace {

// Those that compute any filter.
constexpr SpectralRoute kRoutes[] = {SpectralRoute::kAuto,
                                     SpectralRoute::kSvd,
                                     SpectralRoute::kGram,
                                     SpectralRoute::kParameterGram,
                                     SpectralRoute::kCascade,
                                     SpectralRoute::kGolubKahan};

}  // namespace

SpectralRule::Options SpectralRule::Options::Power() { return Options(); }

SpectralRule::Options SpectralRule::Options::HalfInverse() {
  Options options;
  options.kappa_is_a_setting = false;
  return options;
}

SpectralRule::Options SpectralRule::Options::GaussNewton() {
  Options options;
  options.filter.kappa = 1.0;
  options.kappa_is_a_setting = false;
  return options;
}

SpectralRule::Options SpectralRule::Options::LevenbergMarquardt() {
  Options options;
  options.filter = SpectralFilter::LevenbergMarquardt(0.0, 1e-3);
  return options;
}

void SpectralRule::Options::Describe(OptionSet* set) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  step_size.Describe(/*allow_auto=*/true, set);
  if (filter.kind == SpectralFilter::Kind::kLevenbergMarquardt) {
    set->Add("damping",
             &filter.damping,
             {0.0, kInfinity},
             "added to the squared singular values");
    set->Add("relative_damping",
             &filter.relative_damping,
             {0.0, kInfinity},
             "the same, in units of s_max^2");
  } else {
    if (kappa_is_a_setting) {
      set->Add("kappa",
               &filter.kappa,
               {-1.0, 1.0},
               "exponent: -1 gradient, 1/2 half-inverse, 1 Gauss-Newton");
    }
    set->Add("truncation",
             &filter.tau,
             {0.0, 1.0, false, true},
             "tau: singular values s <= tau s_max are dropped");
    set->Add("clamp",
             &filter.clamp,
             "raise small singular values to tau s_max instead");
  }
  std::vector<std::string> names;
  for (const SpectralRoute candidate : kRoutes) {
    names.emplace_back(SpectralRouteName(candidate));
  }
  set->Add("route", &route, names, "how the step is computed");
  set->Add("tolerance",
           &tolerance,
           {0.0, kInfinity, true},
           "relative error up to which route=auto takes a Gram matrix");
  set->Add("threshold_tolerance",
           &threshold_tolerance,
           {0.0, kInfinity},
           "relative error of the truncation up to which it does");
}

SpectralRule::SpectralRule(const Options& options) : options_(options) {
  CheckOptions(options);
  spectral_options_.tolerance = options_.tolerance;
  spectral_options_.threshold_tolerance = options_.threshold_tolerance;
  for (const SpectralRoute candidate : kRoutes) {
    if (options_.route == SpectralRouteName(candidate)) {
      spectral_options_.route = candidate;
    }
  }
}

LinearizationParts SpectralRule::Needs() const {
  LinearizationParts parts;
  parts.jacobian = true;
  return parts;
}

bool SpectralRule::ComputeStep(const Linearization& at_x,
                               Eigen::VectorXd* step,
                               std::string* error) {
  CHECK(at_x.jacobian != nullptr) << "A joint rule needs J.";
  report_.clear();
  SpectralStepSummary summary;
  if (!SpectralStep(*at_x.jacobian,
                    at_x.loss_gradient,
                    options_.filter,
                    spectral_options_,
                    &workspace_,
                    &direction_,
                    &summary)) {
    *error = summary.message;
    return false;
  }
  double eta = 0.0;
  if (!ScaleDirection(
          at_x, options_.step_size, -direction_, &eta, step, error)) {
    return false;
  }

  std::ostringstream report;
  report.precision(2);
  report << "route " << SpectralRouteName(summary.route);
  if (summary.route != SpectralRoute::kGradient) {
    report << ", rank " << summary.rank << " of "
           << std::min(at_x.jacobian->rows(), at_x.jacobian->cols());
  }
  if (summary.num_undecided > 0) {
    report << ", " << summary.num_undecided << " undecided";
  }
  if (options_.step_size.is_auto()) report << ", step size " << eta;
  if (!summary.message.empty()) report << " (" << summary.message << ")";
  report_ = report.str();
  return true;
}

}  // namespace invgrad
