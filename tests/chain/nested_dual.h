// Exact derivatives of any order for tests: a dual number of dual numbers of
// dual numbers ..
//
//   f(a + b e) = f(a) + f'(a) b e,   e^2 = 0
//
// With one direction a level, the outermost b of b of b .. is the mixed
// derivative along all of them.
#ifndef TESTS_NESTED_DUAL_H_
#define TESTS_NESTED_DUAL_H_

#include <cmath>

namespace invgrad {

template <typename T>
struct Dual {
  T a = T(0.0);
  T b = T(0.0);

  Dual() = default;
  Dual(double value) : a(value) {}  // NOLINT: implicit on purpose
  Dual(const T& a, const T& b) : a(a), b(b) {}

  Dual operator-() const { return {-a, -b}; }
  Dual& operator+=(const Dual& y) { return *this = *this + y; }
  friend Dual operator+(const Dual& x, const Dual& y) {
    return {x.a + y.a, x.b + y.b};
  }
  friend Dual operator-(const Dual& x, const Dual& y) {
    return {x.a - y.a, x.b - y.b};
  }
  friend Dual operator*(const Dual& x, const Dual& y) {
    return {x.a * y.a, x.a * y.b + x.b * y.a};
  }
  friend Dual operator/(const Dual& x, const Dual& y) {
    return {x.a / y.a, (x.b * y.a - x.a * y.b) / (y.a * y.a)};
  }
  friend bool operator<(const Dual& x, const Dual& y) { return x.a < y.a; }
  friend bool operator<=(const Dual& x, const Dual& y) { return !(y < x); }

  friend Dual exp(const Dual& x) {
    using std::exp;
    const T e = exp(x.a);
    return {e, e * x.b};
  }
  friend Dual log(const Dual& x) {
    using std::log;
    return {log(x.a), x.b / x.a};
  }
  friend Dual sqrt(const Dual& x) {
    using std::sqrt;
    const T root = sqrt(x.a);
    return {root, x.b / (T(2.0) * root)};
  }
  friend Dual sin(const Dual& x) {
    using std::cos;
    using std::sin;
    return {sin(x.a), cos(x.a) * x.b};
  }
  friend Dual cos(const Dual& x) {
    using std::cos;
    using std::sin;
    return {cos(x.a), -sin(x.a) * x.b};
  }
  friend Dual tanh(const Dual& x) {
    using std::tanh;
    const T t = tanh(x.a);
    return {t, (T(1.0) - t * t) * x.b};
  }
  friend Dual erfc(const Dual& x) {
    using std::erfc;
    using std::exp;
    return {erfc(x.a), T(-M_2_SQRTPI) * exp(-(x.a * x.a)) * x.b};
  }
};

using Dual4 = Dual<Dual<Dual<Dual<double>>>>;

// `value` + sum_k directions[k] e_k; of level k = 0 .. 3, the outermost first.
inline Dual4 MakeDual4(double value, const double* directions) {
  Dual4 x(value);
  x.b = Dual<Dual<Dual<double>>>(directions[0]);
  x.a.b = Dual<Dual<double>>(directions[1]);
  x.a.a.b = Dual<double>(directions[2]);
  x.a.a.a.b = directions[3];
  return x;
}

// The derivative along the directions of the levels 4 - order .. 3.
inline double DerivativeOf(const Dual4& x, int order) {
  switch (order) {
    case 0:
      return x.a.a.a.a;
    case 1:
      return x.a.a.a.b;
    case 2:
      return x.a.a.b.b;
    case 3:
      return x.a.b.b.b;
    default:
      return x.b.b.b.b;
  }
}

}  // namespace invgrad

#endif  // TESTS_NESTED_DUAL_H_
