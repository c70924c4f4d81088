// Rows of one state, differentiated by Jets as they are added.
//
//   JetRows<3> rows;
//   rows.Reset(x);
//   if (!rows.Add(0, m, row)) return false;      // row(i, jets, &residual)
//   double cost = 0.5 * rows.squared_norm();     // 1/2 |r|^2
//   GramRoot<3> root = rows.Root();              // R and c of J
//
// Fails:   Add returns false where `row` does.
#ifndef INVGRAD_INTERNAL_JET_ROWS_H_
#define INVGRAD_INTERNAL_JET_ROWS_H_

#include <cmath>

#include "ceres/jet.h"
#include "invgrad/internal/streaming_gram.h"

namespace invgrad {

template <int N>
class JetRows {
 public:
  using Jet = ceres::Jet<double, N>;

  // No rows, at x.
  void Reset(const typename GramRoot<N>::Vector& x) {
    for (int j = 0; j < N; ++j) x_[j] = Jet(x[j], j);
    gram_.Reset();
    squared_norm_ = 0.0;
  }

  // Rows begin ... end - 1.
  template <typename Row>
  bool Add(int begin, int end, const Row& row) {
    double sum = squared_norm_;
    for (int i = begin; i < end; ++i) {
      Jet residual;
      if (!row(i, x_, &residual)) return false;
      gram_.AddRow(residual.v.data(), residual.a);
      sum += residual.a * residual.a;
    }
    squared_norm_ = sum;
    return true;
  }

  // The first of these rows that fails or is not finite; -1: none.
  template <typename Row>
  int FirstInvalid(int begin, int end, const Row& row) const {
    for (int i = begin; i < end; ++i) {
      Jet residual;
      if (!row(i, x_, &residual) || !std::isfinite(residual.a * residual.a) ||
          !residual.v.allFinite()) {
        return i;
      }
    }
    return -1;
  }

  double squared_norm() const { return squared_norm_; }
  const GramRoot<N>& Root() { return gram_.Finish(); }

 private:
  Jet x_[N];
  StreamingGram<N> gram_;
  double squared_norm_ = 0.0;
};

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_JET_ROWS_H_
