// Fits with few parameters, much faster than one ceres::Solve for each. FitMany
// makes very many small fits of one model, FitStreaming one fit with very many
// rows. For right-hand sides with common nonlinear parameters use fit_global.h;
// for anything else use ceres::Solve. Options and results: internal/fit_options.h.
#ifndef INVGRAD_FIT_H_
#define INVGRAD_FIT_H_

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "invgrad/internal/fit_options.h"
#include "invgrad/internal/jet_rows.h"
#include "invgrad/internal/levenberg_marquardt.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/parallel.h"
#include "invgrad/internal/streaming_gram.h"

namespace invgrad {

// The rows of one data set, for FitByLevenbergMarquardt.
template <int N, typename Functor>
class DataSetRows {
 public:
  explicit DataSetRows(const Functor& functor) : functor_(functor) {}

  void SetDataSet(int data_set, int num_rows) {
    data_set_ = data_set;
    num_rows_ = num_rows;
  }

  bool Evaluate(const typename GramRoot<N>::Vector& x, double* cost) {
    rows_.Reset(x);
    const bool has_values = rows_.Add(0, num_rows_, Row());
    *cost = 0.5 * rows_.squared_norm();
    return has_values;
  }

  const GramRoot<N>& Root() { return rows_.Root(); }

  int FirstInvalidRow(const typename GramRoot<N>::Vector& x) {
    rows_.Reset(x);
    return rows_.FirstInvalid(0, num_rows_, Row());
  }

 private:
  auto Row() const {
    return [this](int i, const auto* jets, auto* residual) {
      return functor_(data_set_, i, jets, residual);
    };
  }

  const Functor& functor_;
  JetRows<N> rows_;
  int data_set_ = 0;
  int num_rows_ = 0;
};

// Very many small fits of one model: 1e5 data sets and more, each with its own
// start, status, covariance and rank.
//
//   minimize 1/2 sum_i r_i(x_k)^2 over the rows i of data set k, for each k
//
//   struct Decay {  // y = a exp(-b t) + c
//     const double* t; const double* y;
//     template <typename T>
//     bool operator()(int k, int i, const T* x, T* residual) const {
//       using std::exp;
//       *residual = x[0] * exp(-x[1] * t[i]) + x[2] - y[30 * k + i];
//       return true;
//     }
//   };
//   std::vector<FitResult<3>> fits(100000);  // fits[k].x = a start
//   FitMany(FitOptions(), Decay{t, y}, std::vector<int>(100000, 30), &fits);
//   if (fits[7].IsConverged()) Use(fits[7].x[1], fits[7].StandardError(1));
//
// The functor is called with T = ceres::Jet<double, N>, from several threads.
// It returns false where it has no value.
//
// Each fit is what ceres::Solve does with the same options and DENSE_QR
// (internal/levenberg_marquardt.h): the same steps and the same answer up to
// rounding, in a fraction of the time (docs/results/fits.md).
//
// Shapes:  num_rows, fits: one entry a data set.
// Cost:    an iteration evaluates m rows with Jets, and takes 2 m N^2
//          operations. Nothing is allocated for a fit.
// Fails:   a data set that fails has a FitStatus, its start or its best state,
//          and no influence on others. CHECKs the options and the sizes.
// Threads: fits do not depend on their number.
template <int N, typename Functor>
void FitMany(const FitOptions& options,
             const Functor& functor,
             const std::vector<int>& num_rows,
             std::vector<FitResult<N>>* fits) {
  std::string error;
  CHECK(options.IsValid(&error)) << error;
  CHECK_EQ(num_rows.size(), fits->size()) << "one number of rows a data set";
  for (const int rows : num_rows) CHECK_GE(rows, 0) << "rows of a data set";
  const int num_fits = static_cast<int>(fits->size());
  // Fits that take long lie side by side in many data, so that each thread
  // takes the next few rather than a fixed share.
  constexpr int kAtOnce = 16;
  std::atomic<int> next(0);
  const auto fit_some = [&](int /*begin*/, int end) {
    DataSetRows<N, Functor> rows(functor);
    for (int begin; (begin = next.fetch_add(kAtOnce)) < num_fits;) {
      for (int k = begin; k < std::min(num_fits, begin + kAtOnce); ++k) {
        rows.SetDataSet(k, num_rows[k]);
        FitByLevenbergMarquardt<N>(options, &rows, &(*fits)[k]);
      }
    }
    return end;
  };
  const int num_threads =
      std::min(options.num_threads, std::max(1, num_fits / kAtOnce));
  ForShares(num_threads, num_threads, fit_some, 1);
}

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

  int FirstInvalidRow(const typename GramRoot<N>::Vector& x) const {
    JetRows<N> rows;
    rows.Reset(x);
    return rows.FirstInvalid(0, num_rows_, functor_);
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
// The iteration is that of ceres::Solve (internal/levenberg_marquardt.h). The
// rows fall into at most 64 segments, whose triangular factors
// (internal/streaming_gram.h) are joined in their order: the bits do not depend
// on the number of threads.
//
// Cost:    an iteration evaluates all rows with Jets, and takes 2 m N^2
//          operations. Memory: 128 (N + 1) numbers a thread (32 if N <= 4).
// Fails:   FitStatus; fit->x is then the start or the best state. CHECKs the
//          options and the number of rows.
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

#endif  // INVGRAD_FIT_H_
