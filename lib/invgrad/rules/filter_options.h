// The settings of a spectral filter that rules share.
//
//   phi(s) = s (s^2 + lambda)^(-(1 + kappa) / 2)   for s > truncation s_max,
//                                                  else 0
//   lambda = damping + relative_damping s_max^2
#ifndef INVGRAD_RULES_FILTER_OPTIONS_H_
#define INVGRAD_RULES_FILTER_OPTIONS_H_

#include "invgrad/core/option_set.h"
#include "invgrad/spectral/spectral_filter.h"

namespace invgrad {

// Adds kappa, if it is a setting and not what the rule's name says, truncation,
// clamp and the dampings. The filter must outlive the set.
void DescribeFilter(SpectralFilter* filter,
                    bool kappa_is_a_setting,
                    OptionSet* set);

}  // namespace invgrad

#endif  // INVGRAD_RULES_FILTER_OPTIONS_H_
