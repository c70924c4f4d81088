// A fit with few parameters and very many rows, of which none is kept.
//
//   minimize 1/2 sum_i r_i(x)^2,   i = 0 ... m - 1,  m of 1e7, n of 10
//
//   struct Line {
//     const float* t; const float* y;  // in memory, or mapped from a file
//     template <typename T>
//     bool operator()(int i, const T* x, T* residual) const {
//       *residual = x[0] * double(t[i]) + x[1] - double(y[i]);
//       return true;
//     }
//   };
//   FitResult<2> fit;  // fit.x = the start
//   FitStreaming(FitOptions(), 10000000, Line{t, y}, &fit);
//   std::cout << fit.x[0] << " +- " << fit.StandardError(0) << "\n";
//
// The functor is called with T = ceres::Jet<double, N>, from several threads,
// and by each with rising i. It returns false where it has no value.
//
// The iteration is that of ceres::Solve (levenberg_marquardt.h). The rows fall
// into at most 64 segments, whose triangular factors (streaming_gram.h) are
// joined in their order: the bits do not depend on the number of threads.
//
// Cost:    an iteration evaluates all rows with Jets, and takes 2 m N^2
//          operations. Memory: 128 (N + 1) numbers a thread (32 if N <= 4).
// Fails:   FitStatus; fit->x is then the start or the best state. CHECKs the
//          options and the number of rows.
#ifndef INVGRAD_FIT_STREAMING_H_
#define INVGRAD_FIT_STREAMING_H_

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "invgrad/fit.h"
#include "invgrad/internal/jet_rows.h"
#include "invgrad/internal/levenberg_marquardt.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/parallel.h"
#include "invgrad/internal/streaming_gram.h"

namespace invgrad {

// All rows, segment by segment, for FitByLevenbergMarquardt.
template <int N, typename Functor>
class StreamedRows {
 public:
  StreamedRows(int num_threads, int num_rows, const Functor& functor)
      : num_threads_(num_threads),
        num_rows_(num_rows),
        functor_(functor),
        // Their number depends on m alone.
        roots_(std::clamp(num_rows / StreamingGram<N>::kBlockRows, 1, 64)),
        squared_norms_(roots_.size()) {}

  bool Evaluate(const typename GramRoot<N>::Vector& x, double* cost) {
    const int num_segments = static_cast<int>(roots_.size());
    const auto evaluate = [&](int first, int last) {
      JetRows<N> rows;
      for (int segment = first; segment < last; ++segment) {
        rows.Reset(x);
        if (!rows.Add(Begin(segment), Begin(segment + 1), functor_)) {
          return segment;
        }
        squared_norms_[segment] = rows.squared_norm();
        roots_[segment] = rows.Root();
      }
      return last;
    };
    if (ForShares(num_segments, num_threads_, evaluate, 1) < num_segments) {
      return false;
    }
    double sum = 0.0;
    for (const double squared_norm : squared_norms_) sum += squared_norm;
    *cost = 0.5 * sum;
    return true;
  }

  GramRoot<N> Root() const {
    StreamingGram<N> sum;
    for (const GramRoot<N>& root : roots_) sum.Merge(root);
    return sum.Finish();
  }

 private:
  int Begin(int segment) const {
    return static_cast<int>(static_cast<int64_t>(num_rows_) * segment /
                            static_cast<int64_t>(roots_.size()));
  }

  const int num_threads_;
  const int num_rows_;
  const Functor& functor_;
  std::vector<GramRoot<N>> roots_;  // of each segment, as its |r|^2
  std::vector<double> squared_norms_;
};

template <int N, typename Functor>
void FitStreaming(const FitOptions& options,
                  int num_rows,
                  const Functor& functor,
                  FitResult<N>* fit) {
  std::string error;
  CHECK(options.IsValid(&error)) << error;
  CHECK_GE(num_rows, 0);
  StreamedRows<N, Functor> rows(options.num_threads, num_rows, functor);
  FitByLevenbergMarquardt<N>(options, &rows, fit);
}

}  // namespace invgrad

#endif  // INVGRAD_FIT_STREAMING_H_
