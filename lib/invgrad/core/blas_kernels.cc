#include "invgrad/core/blas_kernels.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "fmt/core.h"
#include "invgrad/core/openblas.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

// The x86 kernels of OpenBLAS 0.3 that do not use AVX2.
constexpr std::array<std::string_view, 21> kKernelsBelowAvx2 = {
    "Katmai",       "Coppermine", "Northwood", "Prescott",    "Banias",
    "Atom",         "Core2",      "Penryn",    "Dunnington",  "Nehalem",
    "Athlon",       "Opteron",    "Nano",      "Sandybridge", "Barcelona",
    "Opteron_SSE3", "Unknown",    "Bobcat",    "Bulldozer",   "Piledriver",
    "Steamroller"};

}  // namespace

VectorUnits ProcessorVectorUnits() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  // The instruction sets that OpenBLAS' SkylakeX kernels use.
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") &&
      __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl")) {
    return VectorUnits::kAvx512;
  }
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    return VectorUnits::kAvx2;
  }
#endif
  return VectorUnits::kBelowAvx2;
}

std::string BlasKernels() {
  return openblas_get_corename ? openblas_get_corename() : "";
}

std::string BetterBlasKernels(VectorUnits units, const std::string& kernels) {
  const bool is_old =
      std::find(kKernelsBelowAvx2.begin(), kKernelsBelowAvx2.end(), kernels) !=
      kKernelsBelowAvx2.end();
  if (!is_old || units == VectorUnits::kBelowAvx2) return "";
  return units == VectorUnits::kAvx512 ? "SkylakeX" : "Haswell";
}

std::string OldBlasKernelsMessage() {
  const VectorUnits units = ProcessorVectorUnits();
  const std::string kernels = BlasKernels();
  const std::string better = BetterBlasKernels(units, kernels);
  if (better.empty()) return "";
  return fmt::format(
      "OpenBLAS runs its {} kernels, which do not use the {} of this "
      "processor: "
      "matrix products take about four times as long as they could. Start the "
      "program with OPENBLAS_CORETYPE={} in the environment.",
      kernels,
      units == VectorUnits::kAvx512 ? "AVX-512" : "AVX2",
      better);
}

void WarnOnceOfOldBlasKernels() {
  static const bool done = [] {
    const std::string message = OldBlasKernelsMessage();
    if (!message.empty()) LOG(WARNING) << message;
    return true;
  }();
  static_cast<void>(done);
}

}  // namespace invgrad
