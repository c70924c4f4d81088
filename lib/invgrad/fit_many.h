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
// (levenberg_marquardt.h): the same steps and the same answer up to rounding,
// in a fraction of the time (docs/results/fits.md).
//
// Shapes:  num_rows, fits: one entry a data set.
// Cost:    an iteration evaluates m rows with Jets, and takes 2 m N^2
//          operations. Nothing is allocated for a fit.
// Fails:   a data set that fails has a FitStatus, its start or its best state,
//          and no influence on others. CHECKs the options and the sizes.
// Threads: fits do not depend on their number.
#ifndef INVGRAD_FIT_MANY_H_
#define INVGRAD_FIT_MANY_H_

#include <algorithm>
#include <atomic>
#include <string>
#include <vector>

#include "invgrad/fit.h"
#include "invgrad/internal/jet_rows.h"
#include "invgrad/internal/levenberg_marquardt.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/parallel.h"

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
    const auto row = [this](int i, const auto* jets, auto* residual) {
      return functor_(data_set_, i, jets, residual);
    };
    const bool has_values = rows_.Add(0, num_rows_, row);
    *cost = 0.5 * rows_.squared_norm();
    return has_values;
  }

  const GramRoot<N>& Root() { return rows_.Root(); }

 private:
  const Functor& functor_;
  JetRows<N> rows_;
  int data_set_ = 0;
  int num_rows_ = 0;
};

template <int N, typename Functor>
void FitMany(const FitOptions& options,
             const Functor& functor,
             const std::vector<int>& num_rows,
             std::vector<FitResult<N>>* fits) {
  std::string error;
  CHECK(options.IsValid(&error)) << error;
  CHECK_EQ(num_rows.size(), fits->size()) << "one number of rows a data set";
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

}  // namespace invgrad

#endif  // INVGRAD_FIT_MANY_H_
