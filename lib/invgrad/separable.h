// Eliminates the linear parameters of a ceres::Problem, so that ceres::Solve
// minimizes over the others: variable projection. Use it where residuals are
// affine in some parameters (amplitudes, offsets, points seen by affine
// cameras). For many right-hand sides with common nonlinear parameters use
// fit_global.h. LinearParameters, in this header too, proves in which
// parameters a functor is affine.
//
//   L(alpha) = min_c 1/2 sum_b rho_b(|r_b(alpha, c)|^2),
//   r(alpha, c) = r_0(alpha) + Phi(alpha) c
//
//   std::string error;
//   auto separable = SeparableProblem::Create({}, {{amplitudes}}, &problem,
//                                             &error);
//   if (separable == nullptr) LOG(FATAL) << error;
//   ceres::Solve(options, separable->reduced(), &summary);
//   separable->SolveLinear(&error);                  // amplitudes = c(alpha)
//
// Residual blocks that share linear parameters c form a component, which
// becomes one residual block of the reduced problem (reduced_cost.h). The
// reduced problem has the blocks of the user's problem that are not linear,
// with their values, manifolds, bounds and constness, and the residual blocks
// without linear parameters as they are. Where the linear parameters of each
// component are a few (a point seen by affine cameras), the reduced problem is
// as sparse in the others as a Schur complement.
//
// L has the same minima as the problem, at the same cost. LM needs no start for
// c, and mostly fewer iterations (docs/results/fits.md). But with a loss whose
// rho' is 0 far away (TukeyLoss), the minimum over c is a local one, which
// depends on the start of c. Without a loss in its component, Create sets a
// linear parameter that shares a block with others to zero: Ceres counts its
// size in parameter_tolerance.
//
// Linear parameters that the residuals do not determine have the least norm, in
// units of the lengths of their columns of Phi (linear_projection.h), and
// rank() < num_linear(). ComputeRankReport (rank_report.h) names them. A
// linear parameter that is in no residual block keeps its value.
//
// Cost:    reduced_cost.h. A component has dense matrices of its m residuals, p
//          linear parameters and the n parameters of its other blocks.
// Fails:   Create returns null, with a message, if residuals are not affine in
//          the parameters (affine_check.h; LinearParameters proves it), if a
//          linear parameter has bounds or a manifold, if a loss has rho < 0 or
//          rho' < 0, or if memory does not suffice. CHECKs that the problem has
//          the blocks, and that no parameter is named twice.
// Needs:   cost functions that depend only on their parameters; evaluation
//          callbacks are not called.
// Threads: as ceres::Solve.
#ifndef INVGRAD_SEPARABLE_H_
#define INVGRAD_SEPARABLE_H_

#include <array>
#include <bitset>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "invgrad/internal/linear_projection.h"

namespace invgrad {

// Linear parameters: a block of the problem, or some of its components.
struct LinearBlock {
  double* values;
  std::vector<int> components = {};  // empty: all
};

class ReducedCost;

class SeparableProblem {
 public:
  struct Options {
    // Of Phi, relative to the largest pivot (linear_projection.h).
    double rank_threshold = kLinearRankThreshold;
    // The Jacobian of Golub and Pereyra in place of Kaufman's; not with robust
    // losses. It costs p + 1 evaluations more.
    bool is_golub_pereyra = false;
    // The name of a block; "" or no function: "block i", as in a RankReport.
    std::function<std::string(const double* values)> block_name;
  };

  // The problem must outlive the result, and keep its residual blocks; later
  // changes of blocks, manifolds, bounds and constness have no effect. Linear
  // blocks that are constant stay constant.
  static std::unique_ptr<SeparableProblem> Create(
      const Options& options,
      const std::vector<LinearBlock>& linear,
      ceres::Problem* problem,
      std::string* error);

  ~SeparableProblem();

  // Over the memory of the user's blocks. It owns no manifolds
  // (manifold_ownership of MinimizerOptions and UpdateCallback::Options).
  ceres::Problem* reduced() { return &reduced_; }

  // Sets the linear parameters of the user's blocks to c, at the current values
  // of the others. Returns false, with a message, if a cost function fails, or
  // if the residuals are not affine there.
  bool SolveLinear(std::string* error);

  int num_components() const { return static_cast<int>(costs_.size()); }
  int num_linear() const { return num_linear_; }
  // The sum of the components' ranks of Phi, after SolveLinear.
  int rank() const { return rank_; }

 private:
  class Builder;

  explicit SeparableProblem(const Options& options);
  std::string BlockName(const double* values, int index) const;
  bool CheckAllAffine(std::string* error) const;
  // Sets the linear parameters of the component to zero that share a block with
  // others.
  void ClearSharedBlocks(const ReducedCost& cost);

  const Options options_;
  std::vector<std::unique_ptr<ReducedCost>> costs_;
  // Hold the linear parameters of blocks with others constant.
  std::vector<std::unique_ptr<ceres::Manifold>> manifolds_;
  double constant_ = 0.0;  // the block of a component without others
  int num_linear_ = 0;
  int rank_ = 0;
  ceres::Problem reduced_;
};

// The scalar with which LinearParameters evaluates a functor. It records which
// second derivatives may differ from zero.
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

// The number of cliques of a cover of `free`. An independent set has at most
// one vertex of each.
template <int N>
std::size_t CountCliques(const std::array<std::bitset<N>, N>& edges,
                         std::bitset<N> free) {
  std::size_t cliques = 0;
  for (int i = 0; i < N; ++i) {
    if (!free[i]) continue;
    ++cliques;
    std::bitset<N> candidates = edges[i] & free;
    for (int j = i + 1; j < N && candidates.any(); ++j) {
      if (!candidates[j]) continue;
      candidates &= edges[j];
      free.reset(j);
    }
  }
  return cliques;
}

// Adds vertices of `free` to `chosen`; keeps the largest set, of several the
// lexicographically first. No vertex of `free` has a loop or an edge to
// `chosen`.
template <int N>
void FindIndependentSet(const std::array<std::bitset<N>, N>& edges,
                        std::bitset<N> free,
                        std::bitset<N> chosen,
                        std::bitset<N>* largest) {
  for (int i = 0; i < N; ++i) {
    if (!free[i]) continue;
    if (chosen.count() + CountCliques<N>(edges, free) <= largest->count()) {
      return;
    }
    free.reset(i);
    const std::bitset<N> others = free & ~edges[i];
    std::bitset<N> with_i = chosen;
    with_i.set(i);
    if (others == free) {
      chosen = with_i;
    } else {
      FindIndependentSet<N>(edges, others, with_i, largest);
    }
  }
  if (chosen.count() > largest->count()) *largest = chosen;
}

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
// Cost:    one evaluation, times N^2 / 64 words an operation, and the search
//          for the largest set: milliseconds where few vertices without loops
//          have edges, for chains, and for products of two groups of
//          parameters; exponential in N at worst.
// Fails:   no set, {}, where the functor returns false at b. A functor that
//          uses a function not listed here does not compile.
// Limits:  the functor must not convert T to double on a way to its residuals.
//
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
  typename T::Set without_loop;
  for (int i = 0; i < N; ++i) without_loop[i] = !edges[i][i];
  typename T::Set largest;
  FindIndependentSet<N>(edges, without_loop, {}, &largest);
  std::vector<int> indices;
  for (int i = 0; i < N; ++i) {
    if (largest[i]) indices.push_back(i);
  }
  return indices;
}

}  // namespace invgrad

#endif  // INVGRAD_SEPARABLE_H_
