// The hyperbolic tangent of an array: most of the time of a small network.
#ifndef INVGRAD_CHAIN_TANH_H_
#define INVGRAD_CHAIN_TANH_H_

#include <cstddef>

namespace invgrad {

// z[i] = std::tanh(z[i]), the same bits, four at once if the processor has AVX2
// and FMA and the standard library is the known one.
void TanhAll(std::ptrdiff_t size, double* z);

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_TANH_H_
