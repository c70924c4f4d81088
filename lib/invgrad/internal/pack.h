// A pack of four doubles, one of each of four samples: instantiated with it, or
// with Jets of packs, an ordinary Ceres functor computes four samples at once
// (samples in lanes).
//
// Every lane does the operations of a double, in the same order: the same bits.
// Functions such as sin are called for each lane. A comparison has one result;
// if the lanes disagree, PackBranches::differ() is true, the result is that of
// lane 0, and the samples must be repeated one at a time.
//
// No processor flag is needed: CallInlinedFor chooses AVX2 at run time.
#ifndef INVGRAD_INTERNAL_PACK_H_
#define INVGRAD_INTERNAL_PACK_H_

#include <cmath>
#include <limits>
#include <type_traits>

#include "Eigen/Core"
#include "ceres/jet.h"

namespace invgrad {

// Whether the lanes of a pack have disagreed in a comparison of this thread.
class PackBranches {
 public:
  static bool differ() { return flag_; }
  static void Reset() { flag_ = false; }
  static void Differ() { flag_ = true; }

 private:
  static inline thread_local bool flag_ = false;
};

// Found by their arguments: functions of packs do not hide those of numbers.
namespace pack {

struct Pack {
  static constexpr int kLanes = 4;
  // Aligned as the memory of malloc.
  typedef double Vector __attribute__((vector_size(32), aligned(16)));

  Pack() : v{} {}
  Pack(double value)  // NOLINT: implicit on purpose
      : v{value, value, value, value} {}
  explicit Pack(const Vector& vector) : v(vector) {}
  // A class with its own copy constructor is passed in memory, on every
  // processor.
  Pack(const Pack& other) : v(other.v) {}
  Pack& operator=(const Pack& other) {
    v = other.v;
    return *this;
  }

  double operator[](int lane) const { return v[lane]; }

  Pack& operator+=(const Pack& b) {
    v += b.v;
    return *this;
  }
  Pack& operator-=(const Pack& b) {
    v -= b.v;
    return *this;
  }
  Pack& operator*=(const Pack& b) {
    v *= b.v;
    return *this;
  }
  Pack& operator/=(const Pack& b) {
    v /= b.v;
    return *this;
  }

  Vector v;
};

inline Pack operator+(const Pack& a) { return a; }
inline Pack operator-(const Pack& a) { return Pack(-a.v); }
inline Pack operator+(const Pack& a, const Pack& b) { return Pack(a.v + b.v); }
inline Pack operator-(const Pack& a, const Pack& b) { return Pack(a.v - b.v); }
inline Pack operator*(const Pack& a, const Pack& b) { return Pack(a.v * b.v); }
inline Pack operator/(const Pack& a, const Pack& b) { return Pack(a.v / b.v); }

// test(lane), on which all lanes should agree.
template <typename Test>
auto AgreedTest(const Test& test) {
  const auto first = test(0);
  for (int lane = 1; lane < Pack::kLanes; ++lane) {
    if (test(lane) != first) PackBranches::Differ();
  }
  return first;
}

#define INVGRAD_PACK_COMPARISON(op)                               \
  inline bool operator op(const Pack& a, const Pack& b) {         \
    return AgreedTest([&](int i) { return a[i] op b[i]; });       \
  }                                                               \
  template <int N>                                                \
  bool operator op(const Pack& s, const ceres::Jet<Pack, N>& x) { \
    return s op x.a;                                              \
  }                                                               \
  template <int N>                                                \
  bool operator op(const ceres::Jet<Pack, N>& x, const Pack& s) { \
    return x.a op s;                                              \
  }
INVGRAD_PACK_COMPARISON(<)
INVGRAD_PACK_COMPARISON(<=)
INVGRAD_PACK_COMPARISON(>)
INVGRAD_PACK_COMPARISON(>=)
INVGRAD_PACK_COMPARISON(==)
INVGRAD_PACK_COMPARISON(!=)
#undef INVGRAD_PACK_COMPARISON

// Jets of packs and plain numbers.
#define INVGRAD_PACK_ARITHMETIC(op)                                         \
  template <int N>                                                          \
  ceres::Jet<Pack, N> operator op(double s, const ceres::Jet<Pack, N>& x) { \
    return Pack(s) op x;                                                    \
  }                                                                         \
  template <int N>                                                          \
  ceres::Jet<Pack, N> operator op(const ceres::Jet<Pack, N>& x, double s) { \
    return x op Pack(s);                                                    \
  }
INVGRAD_PACK_ARITHMETIC(+)
INVGRAD_PACK_ARITHMETIC(-)
INVGRAD_PACK_ARITHMETIC(*)
INVGRAD_PACK_ARITHMETIC(/)
#undef INVGRAD_PACK_ARITHMETIC

#define INVGRAD_PACK_FUNCTION(name)                                           \
  inline Pack name(const Pack& x) {                                           \
    return Pack(Pack::Vector{                                                 \
        std::name(x[0]), std::name(x[1]), std::name(x[2]), std::name(x[3])}); \
  }
INVGRAD_PACK_FUNCTION(abs)
INVGRAD_PACK_FUNCTION(acos)
INVGRAD_PACK_FUNCTION(acosh)
INVGRAD_PACK_FUNCTION(asin)
INVGRAD_PACK_FUNCTION(asinh)
INVGRAD_PACK_FUNCTION(atan)
INVGRAD_PACK_FUNCTION(atanh)
INVGRAD_PACK_FUNCTION(cbrt)
INVGRAD_PACK_FUNCTION(ceil)
INVGRAD_PACK_FUNCTION(cos)
INVGRAD_PACK_FUNCTION(cosh)
INVGRAD_PACK_FUNCTION(erf)
INVGRAD_PACK_FUNCTION(erfc)
INVGRAD_PACK_FUNCTION(exp)
INVGRAD_PACK_FUNCTION(exp2)
INVGRAD_PACK_FUNCTION(expm1)
INVGRAD_PACK_FUNCTION(fabs)
INVGRAD_PACK_FUNCTION(floor)
INVGRAD_PACK_FUNCTION(log)
INVGRAD_PACK_FUNCTION(log10)
INVGRAD_PACK_FUNCTION(log1p)
INVGRAD_PACK_FUNCTION(log2)
INVGRAD_PACK_FUNCTION(norm)
INVGRAD_PACK_FUNCTION(round)
INVGRAD_PACK_FUNCTION(sin)
INVGRAD_PACK_FUNCTION(sinh)
INVGRAD_PACK_FUNCTION(sqrt)
INVGRAD_PACK_FUNCTION(tan)
INVGRAD_PACK_FUNCTION(tanh)
#undef INVGRAD_PACK_FUNCTION

#define INVGRAD_PACK_FUNCTION_OF_TWO(name)            \
  inline Pack name(const Pack& x, const Pack& y) {    \
    return Pack(Pack::Vector{std::name(x[0], y[0]),   \
                             std::name(x[1], y[1]),   \
                             std::name(x[2], y[2]),   \
                             std::name(x[3], y[3])}); \
  }
INVGRAD_PACK_FUNCTION_OF_TWO(atan2)
INVGRAD_PACK_FUNCTION_OF_TWO(copysign)
INVGRAD_PACK_FUNCTION_OF_TWO(fdim)
INVGRAD_PACK_FUNCTION_OF_TWO(fmax)
INVGRAD_PACK_FUNCTION_OF_TWO(fmin)
INVGRAD_PACK_FUNCTION_OF_TWO(fmod)
INVGRAD_PACK_FUNCTION_OF_TWO(hypot)
INVGRAD_PACK_FUNCTION_OF_TWO(pow)
#undef INVGRAD_PACK_FUNCTION_OF_TWO

#define INVGRAD_PACK_TEST(name)                                \
  inline auto name(const Pack& x) {                            \
    return AgreedTest([&](int i) { return std::name(x[i]); }); \
  }
INVGRAD_PACK_TEST(fpclassify)
INVGRAD_PACK_TEST(isfinite)
INVGRAD_PACK_TEST(isinf)
INVGRAD_PACK_TEST(isnan)
INVGRAD_PACK_TEST(isnormal)
INVGRAD_PACK_TEST(signbit)
#undef INVGRAD_PACK_TEST

#define INVGRAD_PACK_TEST_OF_TWO(name)                               \
  inline bool name(const Pack& x, const Pack& y) {                   \
    return AgreedTest([&](int i) { return std::name(x[i], y[i]); }); \
  }
INVGRAD_PACK_TEST_OF_TWO(isgreater)
INVGRAD_PACK_TEST_OF_TWO(isgreaterequal)
INVGRAD_PACK_TEST_OF_TWO(isless)
INVGRAD_PACK_TEST_OF_TWO(islessequal)
INVGRAD_PACK_TEST_OF_TWO(islessgreater)
INVGRAD_PACK_TEST_OF_TWO(isunordered)
#undef INVGRAD_PACK_TEST_OF_TWO

// A plain base: pow(2.0, x).
template <int N>
ceres::Jet<Pack, N> pow(double base, const ceres::Jet<Pack, N>& exponent) {
  return pow(Pack(base), exponent);
}

}  // namespace pack

using pack::Pack;

// function(), with everything that it calls inlined.
template <typename Function>
[[gnu::flatten]] auto CallInlined(const Function& function) {
  return function();
}
#ifdef __x86_64__
template <typename Function>
[[gnu::flatten, gnu::target("avx2")]] auto CallInlinedAvx2(
    const Function& function) {
  return function();
}
#endif

// CallInlined for a function that computes with Ts; of packs with AVX2 if the
// processor has it. AVX2 alone has no fused multiply-add: the same bits.
//
// In steps of more than a few dozen operations GCC stops inlining the operators
// of Jets by itself; this makes a Runge-Kutta step three times slower (GCC 12,
// -O3).
template <typename T, typename Function>
auto CallInlinedFor(const Function& function) {
#ifdef __x86_64__
  if constexpr (std::is_same_v<T, Pack>) {
    static const bool has_avx2 = __builtin_cpu_supports("avx2");
    if (has_avx2) return CallInlinedAvx2(function);
  }
#endif
  return CallInlined(function);
}

}  // namespace invgrad

template <>
struct std::numeric_limits<invgrad::Pack> : std::numeric_limits<double> {};

namespace Eigen {

// 2.0 * v and v / 2.0 for a vector v of packs or of their Jets.
template <typename BinaryOp>
struct ScalarBinaryOpTraits<invgrad::Pack, double, BinaryOp> {
  using ReturnType = invgrad::Pack;
};
template <typename BinaryOp>
struct ScalarBinaryOpTraits<double, invgrad::Pack, BinaryOp> {
  using ReturnType = invgrad::Pack;
};
template <typename BinaryOp, int N>
struct ScalarBinaryOpTraits<ceres::Jet<invgrad::Pack, N>, double, BinaryOp> {
  using ReturnType = ceres::Jet<invgrad::Pack, N>;
};
template <typename BinaryOp, int N>
struct ScalarBinaryOpTraits<double, ceres::Jet<invgrad::Pack, N>, BinaryOp> {
  using ReturnType = ceres::Jet<invgrad::Pack, N>;
};

template <>
struct NumTraits<invgrad::Pack> : GenericNumTraits<double> {
  using Real = invgrad::Pack;
  using NonInteger = invgrad::Pack;
  using Nested = invgrad::Pack;
  using Literal = invgrad::Pack;
  enum { RequireInitialization = 1 };
};

}  // namespace Eigen

#endif  // INVGRAD_INTERNAL_PACK_H_
