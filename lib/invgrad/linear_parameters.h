// Proves in which of its parameters a functor is affine, by evaluating it with
// a scalar that records which second derivatives may differ from zero.
//
//   struct Decay {  // y = b0 + b1 exp(-b2 t)
//     template <typename T>
//     bool operator()(const T* b, T* r) const {
//       using std::exp;
//       r[0] = b[0] + b[1] * exp(-b[2] * t) - y;
//       return true;
//     }
//     double t, y;
//   };
//   LinearParameters<3>(Decay{1.0, 2.0}, 1, b);   // {0, 1}
//
// A value depends on some parameters, and on some pairs (i, j) of them not
// linearly:
//
//   x + y           pairs of x and of y
//   x y             these, and (i, j) with i of x and j of y
//   exp(x), ...     all pairs of the parameters of x
//   x < y           no pairs, but all parameters of x and y count as nonlinear,
//                   because other values may take another branch
//
// Parameters are the vertices of a graph whose edges are these pairs. Residuals
// are affine in an independent set whose vertices have no loop (i, i). The
// largest one is returned, of several the lexicographically first: of y = b0 b1
// it is {0}. What is returned is proved for all values; a term that cancels, as
// b0^2 - b0^2, leaves its parameter out.
//
// Cost:    one evaluation, times N^2 / 64 words an operation.
// Fails:   no set, {}, where the functor returns false at b. A functor that
//          uses a function not listed here does not compile.
// Limits:  the functor must not convert T to double on a way to its residuals.
#ifndef INVGRAD_LINEAR_PARAMETERS_H_
#define INVGRAD_LINEAR_PARAMETERS_H_

#include <array>
#include <bitset>
#include <cmath>
#include <vector>

namespace invgrad {

template <int N>
class TracedScalar {
 public:
  using Set = std::bitset<N>;
  using Pairs = std::array<Set, N>;  // symmetric

  TracedScalar() = default;
  TracedScalar(double value) : value_(value) {}  // NOLINT: implicit on purpose
  TracedScalar(double value, int parameter) : value_(value) {
    depends_.set(parameter);
  }

  const Pairs& pairs() const { return pairs_; }
  // The parameters of all comparisons of this thread since it was cleared.
  static Set& Compared() {
    static thread_local Set compared;
    return compared;
  }

  TracedScalar operator-() const { return Linear(-value_, *this, *this); }
  TracedScalar operator+() const { return *this; }
  friend TracedScalar operator+(const TracedScalar& x, const TracedScalar& y) {
    return Linear(x.value_ + y.value_, x, y);
  }
  friend TracedScalar operator-(const TracedScalar& x, const TracedScalar& y) {
    return Linear(x.value_ - y.value_, x, y);
  }
  friend TracedScalar operator*(const TracedScalar& x, const TracedScalar& y) {
    TracedScalar z = Linear(x.value_ * y.value_, x, y);
    z.AddPairs(x.depends_, y.depends_);
    return z;
  }
  friend TracedScalar operator/(const TracedScalar& x, const TracedScalar& y) {
    return x * Nonlinear(1.0 / y.value_, y, y);
  }
  TracedScalar& operator+=(const TracedScalar& y) { return *this = *this + y; }
  TracedScalar& operator-=(const TracedScalar& y) { return *this = *this - y; }
  TracedScalar& operator*=(const TracedScalar& y) { return *this = *this * y; }
  TracedScalar& operator/=(const TracedScalar& y) { return *this = *this / y; }

#define INVGRAD_TRACED_FUNCTION(f)               \
  friend TracedScalar f(const TracedScalar& x) { \
    return Nonlinear(std::f(x.value_), x, x);    \
  }
  INVGRAD_TRACED_FUNCTION(abs)
  INVGRAD_TRACED_FUNCTION(acos)
  INVGRAD_TRACED_FUNCTION(asin)
  INVGRAD_TRACED_FUNCTION(atan)
  INVGRAD_TRACED_FUNCTION(cbrt)
  INVGRAD_TRACED_FUNCTION(cos)
  INVGRAD_TRACED_FUNCTION(cosh)
  INVGRAD_TRACED_FUNCTION(erf)
  INVGRAD_TRACED_FUNCTION(erfc)
  INVGRAD_TRACED_FUNCTION(exp)
  INVGRAD_TRACED_FUNCTION(exp2)
  INVGRAD_TRACED_FUNCTION(expm1)
  INVGRAD_TRACED_FUNCTION(log)
  INVGRAD_TRACED_FUNCTION(log10)
  INVGRAD_TRACED_FUNCTION(log1p)
  INVGRAD_TRACED_FUNCTION(log2)
  INVGRAD_TRACED_FUNCTION(sin)
  INVGRAD_TRACED_FUNCTION(sinh)
  INVGRAD_TRACED_FUNCTION(sqrt)
  INVGRAD_TRACED_FUNCTION(tan)
  INVGRAD_TRACED_FUNCTION(tanh)
#undef INVGRAD_TRACED_FUNCTION
#define INVGRAD_TRACED_FUNCTION(f)                                      \
  friend TracedScalar f(const TracedScalar& x, const TracedScalar& y) { \
    return Nonlinear(std::f(x.value_, y.value_), x, y);                 \
  }
  INVGRAD_TRACED_FUNCTION(atan2)
  INVGRAD_TRACED_FUNCTION(fmax)
  INVGRAD_TRACED_FUNCTION(fmin)
  INVGRAD_TRACED_FUNCTION(hypot)
  INVGRAD_TRACED_FUNCTION(pow)
#undef INVGRAD_TRACED_FUNCTION
#define INVGRAD_TRACED_COMPARISON(op)                                     \
  friend bool operator op(const TracedScalar& x, const TracedScalar& y) { \
    Compared() |= x.depends_ | y.depends_;                                \
    return x.value_ op y.value_;                                          \
  }
  INVGRAD_TRACED_COMPARISON(<)
  INVGRAD_TRACED_COMPARISON(<=)
  INVGRAD_TRACED_COMPARISON(>)
  INVGRAD_TRACED_COMPARISON(>=)
  INVGRAD_TRACED_COMPARISON(==)
  INVGRAD_TRACED_COMPARISON(!=)
#undef INVGRAD_TRACED_COMPARISON

 private:
  static TracedScalar Linear(double value,
                             const TracedScalar& x,
                             const TracedScalar& y) {
    TracedScalar z(value);
    z.depends_ = x.depends_ | y.depends_;
    for (int i = 0; i < N; ++i) z.pairs_[i] = x.pairs_[i] | y.pairs_[i];
    return z;
  }
  static TracedScalar Nonlinear(double value,
                                const TracedScalar& x,
                                const TracedScalar& y) {
    TracedScalar z = Linear(value, x, y);
    z.AddPairs(z.depends_, z.depends_);
    return z;
  }
  void AddPairs(const Set& a, const Set& b) {
    for (int i = 0; i < N; ++i) {
      if (a[i]) pairs_[i] |= b;
      if (b[i]) pairs_[i] |= a;
    }
  }

  double value_ = 0.0;
  Set depends_;
  Pairs pairs_;
};

// Adds to `chosen` the vertices from `next` on; keeps the largest set.
template <int N>
void FindIndependentSet(const std::array<std::bitset<N>, N>& edges,
                        int next,
                        std::vector<int>* chosen,
                        std::vector<int>* largest) {
  if (chosen->size() > largest->size()) *largest = *chosen;
  for (int i = next; i < N && chosen->size() + N - i > largest->size(); ++i) {
    bool is_free = !edges[i][i];
    for (const int j : *chosen) is_free = is_free && !edges[i][j];
    if (!is_free) continue;
    chosen->push_back(i);
    FindIndependentSet<N>(edges, i + 1, chosen, largest);
    chosen->pop_back();
  }
}

// The functor is that of an AutoDiffCostFunction with one block, b.
template <int N, typename Functor>
std::vector<int> LinearParameters(const Functor& functor,
                                  int num_residuals,
                                  const double* b) {
  using T = TracedScalar<N>;
  std::array<T, N> parameters;
  for (int i = 0; i < N; ++i) parameters[i] = T(b[i], i);
  std::vector<T> residuals(num_residuals);
  T::Compared().reset();
  if (!functor(parameters.data(), residuals.data())) return {};
  typename T::Pairs edges = {};
  for (int i = 0; i < N; ++i) {
    for (const T& r : residuals) edges[i] |= r.pairs()[i];
    if (T::Compared()[i]) edges[i].set(i);
  }
  std::vector<int> chosen;
  std::vector<int> largest;
  FindIndependentSet<N>(edges, 0, &chosen, &largest);
  return largest;
}

}  // namespace invgrad

#endif  // INVGRAD_LINEAR_PARAMETERS_H_
