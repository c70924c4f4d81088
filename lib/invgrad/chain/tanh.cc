// tanh and expm1 of FreeBSD's msun and of glibc [1], for four numbers:
//
//   t = expm1(2 |x|),    tanh |x| = 1 - 2 / (t + 2)    if |x| >= 1
//   t = expm1(-2 |x|),   tanh |x| = -t / (t + 2)       otherwise
//
// with expm1(y) = 2^k (1 + expm1(r)) - 1, |r| <= ln(2) / 2, in which glibc's
// code for processors with FMA contracts some products. A check at the first
// call compares the bits with those of std::tanh, which is used where they
// differ.
//
// [1] Sun Microsystems, fdlibm 5.3, s_tanh.c and s_expm1.c.
#include "invgrad/chain/tanh.h"

#include <cmath>

#ifdef __x86_64__
#include <immintrin.h>
#endif

namespace invgrad {
namespace {

void TanhOneAtATime(std::ptrdiff_t size, double* z) {
  for (std::ptrdiff_t i = 0; i < size; ++i) z[i] = std::tanh(z[i]);
}

#ifdef __x86_64__

#define INVGRAD_FMA [[gnu::target("avx2,fma")]]

typedef double Vector __attribute__((vector_size(32)));

INVGRAD_FMA inline Vector All(double value) { return _mm256_set1_pd(value); }
// a b, which the compiler must not contract with a sum.
INVGRAD_FMA inline Vector Product(Vector a, Vector b) {
  Vector product = a * b;
  asm("" : "+x"(product));
  return product;
}
INVGRAD_FMA inline Vector Fma(Vector a, Vector b, Vector c) {
  return _mm256_fmadd_pd(a, b, c);
}
// 2^k for a whole number |k| < 1000.
INVGRAD_FMA inline Vector PowerOfTwo(Vector k) {
  // The low bits of the sum are k + 1023.
  const __m256i bits = _mm256_castpd_si256(k + All(0x1.8p52 + 1023.0));
  return _mm256_castsi256_pd(_mm256_slli_epi64(bits, 52));
}
template <int kComparison>
INVGRAD_FMA inline Vector Select(Vector a, Vector b, Vector yes, Vector no) {
  return _mm256_blendv_pd(no, yes, _mm256_cmp_pd(a, b, kComparison));
}

// expm1(y) for y in [2, 44) or (-2, -2^-54].
INVGRAD_FMA inline Vector Expm1(Vector y) {
  const Vector zero = All(0.0), half = All(0.5), one = All(1.0);
  const Vector size = _mm256_andnot_pd(All(-0.0), y);
  // y = k ln 2 + r + c, c a correction of r. The bounds are those of the upper
  // words of ln(2) / 2 and 3/2 ln 2.
  Vector k = Product(All(1.44269504088896338700), y) +
             Select<_CMP_LT_OQ>(y, zero, -half, half);
  k = _mm256_round_pd(k, _MM_FROUND_TO_ZERO | _MM_FROUND_NO_EXC);
  k = Select<_CMP_LT_OQ>(size, All(0x1.0a2b2p0), -one, k);
  k = Select<_CMP_LT_OQ>(size, All(0x1.62e43p-2), zero, k);
  const Vector high = Fma(-k, All(6.93147180369123816490e-01), y);
  const Vector low = Product(k, All(1.90821492927058770002e-10));
  const Vector r = high - low;
  const Vector c = (high - r) - low;

  const Vector r_half = half * r;
  const Vector h = Product(r, r_half);
  const Vector h2 = Product(h, h);
  const Vector h4 = Product(h2, h2);
  const Vector R1 = Fma(h, All(-3.33333333333331316428e-02), one);
  const Vector R2 =
      Fma(h, All(-7.93650757867487942473e-05), All(1.58730158725481460165e-03));
  const Vector R3 =
      Fma(h, All(-2.01099218183624371326e-07), All(4.00821782732936239552e-06));
  const Vector R = Fma(h4, R3, Fma(h2, R2, R1));
  const Vector t = Fma(-R, r_half, All(3.0));
  const Vector e = Product((R - t) / Fma(-r, t, All(6.0)), h);

  const Vector at_k_0 = r - Fma(e, r, -h);
  const Vector e_k = Fma(e - c, r, -c) - h;
  const Vector at_k_minus_1 = Fma(half, r - e_k, -half);
  const Vector power = PowerOfTwo(k);
  const Vector inverse = PowerOfTwo(-k);
  const Vector small_k = Product((one - inverse) - (e_k - r), power);
  const Vector middle_k = Product((r - (e_k + inverse)) + one, power);
  const Vector other_k = Product(one - (e_k - r), power) - one;
  Vector result = Select<_CMP_LT_OQ>(k, All(20.0), small_k, middle_k);
  result = Select<_CMP_GT_OQ>(k, All(56.0), other_k, result);
  result = Select<_CMP_LT_OQ>(k, -one, other_k, result);
  result = Select<_CMP_EQ_OQ>(k, -one, at_k_minus_1, result);
  return Select<_CMP_EQ_OQ>(k, zero, at_k_0, result);
}

INVGRAD_FMA void TanhFourAtOnce(std::ptrdiff_t size, double* z) {
  const Vector one = All(1.0), two = All(2.0);
  std::ptrdiff_t i = 0;
  for (; i + 4 <= size; i += 4) {
    const Vector x = _mm256_loadu_pd(z + i);
    const Vector magnitude = _mm256_andnot_pd(All(-0.0), x);
    const Vector is_usual =
        _mm256_and_pd(_mm256_cmp_pd(magnitude, All(0x1p-55), _CMP_GE_OQ),
                      _mm256_cmp_pd(magnitude, All(22.0), _CMP_LT_OQ));
    if (_mm256_movemask_pd(is_usual) != 15) {
      TanhOneAtATime(4, z + i);
      continue;
    }
    const Vector t = Expm1(
        Select<_CMP_GE_OQ>(magnitude, one, two * magnitude, -two * magnitude));
    const Vector quotient =
        Select<_CMP_GE_OQ>(magnitude, one, two, -t) / (t + two);
    const Vector value =
        Select<_CMP_GE_OQ>(magnitude, one, one - quotient, quotient);
    _mm256_storeu_pd(z + i, _mm256_or_pd(value, _mm256_and_pd(x, All(-0.0))));
  }
  TanhOneAtATime(size - i, z + i);
}

#undef INVGRAD_FMA

// Compares numbers of all sizes with std::tanh.
bool CanFourAtOnce() {
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) {
    return false;
  }
  double x = 0x1p-56;
  while (x < 23.0) {
    double pack[4], expected[4];
    for (int i = 0; i < 4; ++i) {
      x *= x < 0.01 ? 1.37 : 1.0037;
      pack[i] = i % 2 == 0 ? x : -x;
      expected[i] = std::tanh(pack[i]);
    }
    TanhFourAtOnce(4, pack);
    for (int i = 0; i < 4; ++i) {
      if (pack[i] != expected[i]) return false;
    }
  }
  return true;
}

#endif

}  // namespace

void TanhAll(std::ptrdiff_t size, double* z) {
#ifdef __x86_64__
  static const bool four_at_once = CanFourAtOnce();
  if (four_at_once) return TanhFourAtOnce(size, z);
#endif
  TanhOneAtATime(size, z);
}

}  // namespace invgrad
