// Vectorized loops for a library that runs on any x86-64, and their memory.
//
// A kernel is written once, with packs of four numbers and functions that are
// always inlined. Run() compiles the kernel for AVX2 with FMA and for the
// baseline, and chooses at run time:
//
//   Run([&]() INVGRAD_INLINE { Kernel(m, A, x); });
//
// Both give the same result up to rounding: a multiplication and an addition
// are rounded once with FMA and twice without.
#ifndef INVGRAD_SPECTRAL_ROUTES_SIMD_H_
#define INVGRAD_SPECTRAL_ROUTES_SIMD_H_

#include <cstddef>
#include <memory>
#include <new>

#define INVGRAD_INLINE __attribute__((always_inline))

namespace invgrad {
namespace simd {

// Four numbers. Never pass or return them by value: the calling convention
// depends on the instruction set.
constexpr int kPack = 4;
typedef double Pack __attribute__((vector_size(32)));

// Four numbers in memory, at any address: At(x).v.
struct __attribute__((packed, may_alias)) Slot {
  Pack v;
};
INVGRAD_INLINE inline Slot& At(double* x) {
  return *reinterpret_cast<Slot*>(x);
}
INVGRAD_INLINE inline const Slot& At(const double* x) {
  return *reinterpret_cast<const Slot*>(x);
}

INVGRAD_INLINE inline double Sum(const Pack& x) {
  return (x[0] + x[1]) + (x[2] + x[3]);
}

// x^T y of vectors of size n. Two chains of additions hide their latency.
INVGRAD_INLINE inline double Dot(int n, const double* x, const double* y) {
  Pack even = {};
  Pack odd = {};
  int i = 0;
  for (; i + 2 * kPack <= n; i += 2 * kPack) {
    even += At(x + i).v * At(y + i).v;
    odd += At(x + i + kPack).v * At(y + i + kPack).v;
  }
  even += odd;
  double sum = Sum(even);
  for (; i < n; ++i) sum += x[i] * y[i];
  return sum;
}

#if defined(__x86_64__)

template <typename Kernel>
__attribute__((target("avx2,fma"))) void RunWithAvx2(const Kernel& kernel) {
  kernel();
}

template <typename Kernel>
void Run(const Kernel& kernel) {
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    RunWithAvx2(kernel);
  } else {
    kernel();
  }
}

#else

template <typename Kernel>
void Run(const Kernel& kernel) {
  kernel();
}

#endif

}  // namespace simd

// A buffer that a computation reuses between calls, aligned to a cache line. It
// grows and never shrinks.
class AlignedBuffer {
 public:
  // At least `size` uninitialized numbers. Invalidates earlier pointers if the
  // buffer grows.
  double* Reserve(std::size_t size) {
    if (size > size_) {
      data_.reset();  // frees memory before the new allocation
      data_.reset(static_cast<double*>(
          ::operator new(size * sizeof(double), kAlignment)));
      size_ = size;
    }
    return data_.get();
  }
  const double* data() const { return data_.get(); }

 private:
  static constexpr std::align_val_t kAlignment{64};
  struct Delete {
    void operator()(double* data) const { ::operator delete(data, kAlignment); }
  };

  std::size_t size_ = 0;
  std::unique_ptr<double, Delete> data_;
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_SIMD_H_
