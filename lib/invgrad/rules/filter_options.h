// The settings of a power filter that rules share.
//
//   phi(s) = s^-kappa for s > truncation s_max, else 0
#ifndef INVGRAD_RULES_FILTER_OPTIONS_H_
#define INVGRAD_RULES_FILTER_OPTIONS_H_

#include "invgrad/linalg/spectral_filter.h"
#include "invgrad/rules/option_set.h"

namespace invgrad {

// Adds kappa, if it is a setting and not what the rule's name says, truncation
// and clamp. The filter must outlive the set.
void DescribePowerFilter(SpectralFilter* filter,
                         bool kappa_is_a_setting,
                         OptionSet* set);

}  // namespace invgrad

#endif  // INVGRAD_RULES_FILTER_OPTIONS_H_
