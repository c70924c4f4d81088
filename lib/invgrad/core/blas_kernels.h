// Whether OpenBLAS runs kernels that use the processor's vector units.
//
// OpenBLAS chooses its kernels by the processor's family and model. For a model
// that is newer than itself it may fall back to the oldest ones (Debian 12's
// 0.3.21 to Prescott, which has SSE3 only): right results, at a quarter of the
// speed. The environment variable OPENBLAS_CORETYPE, read when the process
// starts, overrules that choice.
#ifndef INVGRAD_CORE_BLAS_KERNELS_H_
#define INVGRAD_CORE_BLAS_KERNELS_H_

#include <string>

namespace invgrad {

// The widest vector instructions that both the processor and the operating
// system support and OpenBLAS has kernels for.
enum class VectorUnits { kBelowAvx2, kAvx2, kAvx512 };

VectorUnits ProcessorVectorUnits();

// The name of the kernels that OpenBLAS runs in this process, e.g. "Haswell";
// empty if BLAS is another one.
std::string BlasKernels();

// The value of OPENBLAS_CORETYPE for a processor with these units. Empty if
// none is needed: the kernels called `kernels` use AVX2 or better, or are not
// known, or the processor has no AVX2.
std::string BetterBlasKernels(VectorUnits units, const std::string& kernels);

// A message that names the kernels and how to set the variable, if the kernels
// are too old; otherwise empty.
std::string OldBlasKernelsMessage();

// Logs this message as a WARNING, once per process. The functions of
// internal/blas.h call it.
void WarnOnceOfOldBlasKernels();

}  // namespace invgrad

#endif  // INVGRAD_CORE_BLAS_KERNELS_H_
