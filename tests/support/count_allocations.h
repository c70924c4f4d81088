// Counts the allocations of a piece of code, in an executable that uses this
// header: it replaces malloc there.
#ifndef INVGRAD_TESTS_SUPPORT_COUNT_ALLOCATIONS_H_
#define INVGRAD_TESTS_SUPPORT_COUNT_ALLOCATIONS_H_

#include <functional>

namespace invgrad {

// False where a sanitizer owns malloc, or without glibc: all counts are then 0.
bool CountsAllocations();

// Of this thread, without those of OpenBLAS, whose kernels for small matrices
// allocate their buffers anew in each call on some processors (AVX-512).
long CountAllocations(const std::function<void()>& function);

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_COUNT_ALLOCATIONS_H_
