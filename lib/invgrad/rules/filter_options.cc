#include "invgrad/rules/filter_options.h"

#include <limits>

namespace invgrad {

void DescribeFilter(SpectralFilter* filter,
                    bool kappa_is_a_setting,
                    OptionSet* set) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (kappa_is_a_setting) {
    set->Add("kappa",
             &filter->kappa,
             {-1.0, 1.0},
             "exponent: -1 gradient, 1/2 half-inverse, 1 Gauss-Newton");
  }
  set->Add("truncation",
           &filter->tau,
           {0.0, 1.0, false, true},
           "tau: singular values s <= tau s_max are dropped");
  set->Add("clamp",
           &filter->clamp,
           "raise small singular values to tau s_max instead");
  set->Add("damping",
           &filter->damping,
           {0.0, kInfinity},
           "lambda, added to the squared singular values");
  set->Add("relative_damping",
           &filter->relative_damping,
           {0.0, kInfinity},
           "the same, in units of s_max^2");
}

}  // namespace invgrad
