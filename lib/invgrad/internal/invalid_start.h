// Finds the parameter because of which a function has no value at the start: the
// first one that another value of its own suffices to mend.
//
//   r = log(1 - x_1 t):  x_1 = 3 has no value, x_1 = 1.5 has
//
// The values that are tried are those of OtherValues, which differ from x in
// size and sign.
#ifndef INVGRAD_INTERNAL_INVALID_START_H_
#define INVGRAD_INTERNAL_INVALID_START_H_

#include <array>

namespace invgrad {

inline std::array<double, 8> OtherValues(double x) {
  return {0.5 * x, 2.0 * x, -x, 0.1 * x, 10.0 * x, 1.0, 0.0, -1.0};
}

// has_value(j, value): whether it has a value with x_j = value. Returns the
// parameter and sets *valid_value, or returns -1.
template <typename Values, typename HasValue>
int FindInvalidParameter(const Values& x,
                         int size,
                         const HasValue& has_value,
                         double* valid_value) {
  for (int j = 0; j < size; ++j) {
    for (const double value : OtherValues(x[j])) {
      if (value == x[j] || !has_value(j, value)) continue;
      *valid_value = value;
      return j;
    }
  }
  return -1;
}

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_INVALID_START_H_
