// Jets of Jets: exact second derivatives of an ordinary Ceres functor.
//
//   f(x + u + w) = f + J u + J w + u^T H w,  u the outer, w the inner part
//
// ceres::Jet<ceres::Jet<double, M>, N> itself does not compile in functors that
// write T(2.0) or 2.0 * x, because the inner Jet has no implicit constructor
// from double. InnerJet adds that constructor, and the operators
// below combine plain numbers with nested Jets.
//
// For y = f(x) evaluated on x[i] = MakeHessianJet<N>(x_i, i):
//   y.a.a = f,   y.v[i].a = df/dx_i,   y.v[i].v[j] = d2f/dx_i dx_j.
#ifndef INVGRAD_INTERNAL_NESTED_JET_H_
#define INVGRAD_INTERNAL_NESTED_JET_H_

#include <cmath>
#include <limits>

#include "Eigen/Core"
#include "ceres/jet.h"

namespace invgrad {

template <int M>
struct InnerJet : public ceres::Jet<double, M> {
  using Base = ceres::Jet<double, M>;
  InnerJet() = default;
  InnerJet(double value) : Base(value) {}       // NOLINT: implicit on purpose
  InnerJet(const Base& value) : Base(value) {}  // NOLINT: implicit on purpose
};

// Outer partial derivatives: N of them; inner ones: M.
template <int N, int M = N>
using NestedJet = ceres::Jet<InnerJet<M>, N>;

// The variable number `index` of N, for a full Hessian.
template <int N>
NestedJet<N> MakeHessianJet(double value, int index) {
  NestedJet<N> x;
  x.a = InnerJet<N>(ceres::Jet<double, N>(value, index));
  x.v[index] = InnerJet<N>(1.0);
  return x;
}

#define INVGRAD_NESTED_JET_ARITHMETIC(op)                                     \
  template <int M, int N>                                                     \
  ceres::Jet<InnerJet<M>, N> operator op(                                     \
      double s, const ceres::Jet<InnerJet<M>, N>& x) {                        \
    return InnerJet<M>(s) op x;                                               \
  }                                                                           \
  template <int M, int N>                                                     \
  ceres::Jet<InnerJet<M>, N> operator op(const ceres::Jet<InnerJet<M>, N>& x, \
                                         double s) {                          \
    return x op InnerJet<M>(s);                                               \
  }
INVGRAD_NESTED_JET_ARITHMETIC(+)
INVGRAD_NESTED_JET_ARITHMETIC(-)
INVGRAD_NESTED_JET_ARITHMETIC(*)
INVGRAD_NESTED_JET_ARITHMETIC(/)
#undef INVGRAD_NESTED_JET_ARITHMETIC

#define INVGRAD_NESTED_JET_COMPARISON(op)                           \
  template <int M>                                                  \
  bool operator op(double s, const InnerJet<M>& x) {                \
    return s op x.a;                                                \
  }                                                                 \
  template <int M>                                                  \
  bool operator op(const InnerJet<M>& x, double s) {                \
    return x.a op s;                                                \
  }                                                                 \
  template <int M>                                                  \
  bool operator op(const InnerJet<M>& x, const InnerJet<M>& y) {    \
    return x.a op y.a;                                              \
  }                                                                 \
  template <int M, int N>                                           \
  bool operator op(double s, const ceres::Jet<InnerJet<M>, N>& x) { \
    return s op x.a.a;                                              \
  }                                                                 \
  template <int M, int N>                                           \
  bool operator op(const ceres::Jet<InnerJet<M>, N>& x, double s) { \
    return x.a.a op s;                                              \
  }
INVGRAD_NESTED_JET_COMPARISON(<)
INVGRAD_NESTED_JET_COMPARISON(<=)
INVGRAD_NESTED_JET_COMPARISON(>)
INVGRAD_NESTED_JET_COMPARISON(>=)
INVGRAD_NESTED_JET_COMPARISON(==)
INVGRAD_NESTED_JET_COMPARISON(!=)
#undef INVGRAD_NESTED_JET_COMPARISON

// For fmin, fmax and fdim.
#define INVGRAD_INNER_JET_QUIET_COMPARISON(compare)          \
  template <int M>                                           \
  bool compare(const InnerJet<M>& x, const InnerJet<M>& y) { \
    return std::compare(x.a, y.a);                           \
  }
INVGRAD_INNER_JET_QUIET_COMPARISON(isless)
INVGRAD_INNER_JET_QUIET_COMPARISON(isgreater)
INVGRAD_INNER_JET_QUIET_COMPARISON(islessgreater)
#undef INVGRAD_INNER_JET_QUIET_COMPARISON

// A plain base: pow(2.0, x).
template <int M, int N>
ceres::Jet<InnerJet<M>, N> pow(double base,
                               const ceres::Jet<InnerJet<M>, N>& exponent) {
  return pow(InnerJet<M>(base), exponent);
}

}  // namespace invgrad

// The standard's default has infinity() == 0.
template <int M>
struct std::numeric_limits<invgrad::InnerJet<M>>
    : std::numeric_limits<ceres::Jet<double, M>> {};

namespace Eigen {

// 2.0 * v and v / 2.0 for a vector v of nested Jets.
template <typename BinaryOp, int M, int N>
struct ScalarBinaryOpTraits<ceres::Jet<invgrad::InnerJet<M>, N>,
                            double,
                            BinaryOp> {
  using ReturnType = ceres::Jet<invgrad::InnerJet<M>, N>;
};
template <typename BinaryOp, int M, int N>
struct ScalarBinaryOpTraits<double,
                            ceres::Jet<invgrad::InnerJet<M>, N>,
                            BinaryOp> {
  using ReturnType = ceres::Jet<invgrad::InnerJet<M>, N>;
};

template <int M>
struct NumTraits<invgrad::InnerJet<M>> : NumTraits<ceres::Jet<double, M>> {
  using Real = invgrad::InnerJet<M>;
  using NonInteger = invgrad::InnerJet<M>;
  using Nested = invgrad::InnerJet<M>;
  using Literal = invgrad::InnerJet<M>;
  static invgrad::InnerJet<M> dummy_precision() { return 1e-12; }
};

}  // namespace Eigen

#endif  // INVGRAD_INTERNAL_NESTED_JET_H_
