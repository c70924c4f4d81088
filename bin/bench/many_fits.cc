// fits/many_POINTS/METHOD: 1,000 fits of a exp(-b t) + c, by the same functor,
// starts and tolerances, one after the other.
//
//   fit_many           FitMany, which always gives the covariance
//   ceres              a new ceres::Problem for each data set, a residual block
//                      for each point, as in Ceres' example curve_fitting.cc,
//                      default linear solver
//   ceres_qr           the same with DENSE_QR
//   ceres_block        one block for all points, DENSE_QR
//   ..._covariance     with ceres::Covariance, DENSE_SVD, which alone allows for
//                      rank deficiency
//   tiny_solver        ceres::TinySolver

#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "benchmark/benchmark.h"
#include "bin/bench/bench.h"
#include "ceres/autodiff_cost_function.h"
#include "ceres/covariance.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "ceres/tiny_solver.h"
#include "ceres/tiny_solver_autodiff_function.h"
#include "fmt/core.h"
#include "invgrad/fit.h"
#include "invgrad/random.h"

namespace invgrad {
namespace {

constexpr int kFits = 1000;

struct ManyData {
  std::vector<double> t;
  std::vector<double> y;  // of one data set after the other

  explicit ManyData(int num_points) {
    NumpyRandom random(1);
    for (int i = 0; i < num_points; ++i) t.push_back(3.0 * i / num_points);
    for (int k = 0; k < kFits; ++k) {
      const double a = random.Uniform(1.0, 5.0);
      const double b = random.Uniform(0.5, 2.5);
      const double c = random.Uniform(0.0, 1.0);
      const Eigen::VectorXd noise = random.Normal(num_points);
      for (int i = 0; i < num_points; ++i) {
        y.push_back(a * std::exp(-b * t[i]) + c + 0.02 * noise[i]);
      }
    }
  }
};

const Eigen::Vector3d kStart(1.0, 1.0, 0.0);

// [decay]
// y = a exp(-b t) + c: row i of data set k.
struct Decay {
  const double* t;
  const double* y;
  int num_points;

  template <typename T>
  bool operator()(int k, int i, const T* x, T* residual) const {
    using std::exp;
    *residual = x[0] * exp(-x[1] * t[i]) + x[2] - y[num_points * k + i];
    return true;
  }
};
// [/decay]

// Rows of it as a cost function.
struct DecayBlock {
  using Scalar = double;
  enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = 3 };

  Decay decay;
  int data_set;
  int begin;
  int end;

  int NumResiduals() const { return end - begin; }

  template <typename T>
  bool operator()(const T* x, T* residuals) const {
    for (int i = begin; i < end; ++i) {
      decay(data_set, i, x, &residuals[i - begin]);
    }
    return true;
  }
};

using Fits = std::vector<FitResult<3>>;
using CostFunction = ceres::AutoDiffCostFunction<DecayBlock, ceres::DYNAMIC, 3>;

struct CeresWay {
  bool is_default = false;  // linear solver; otherwise DENSE_QR
  bool has_block_for_each_point = false;
  bool has_covariance = false;
};

// The fit of data set k as a user of Ceres writes it.
void SolveByCeres(const CeresWay& way,
                  const Decay& decay,
                  int k,
                  FitResult<3>* fit) {
  double x[3] = {kStart[0], kStart[1], kStart[2]};
  ceres::Problem problem;
  const int step = way.has_block_for_each_point ? 1 : decay.num_points;
  for (int begin = 0; begin < decay.num_points; begin += step) {
    const int end = begin + step;
    if (step == 1) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<DecayBlock, 1, 3>(
              new DecayBlock{decay, k, begin, end}),
          nullptr,
          x);
    } else {
      problem.AddResidualBlock(
          new CostFunction(new DecayBlock{decay, k, begin, end}, step),
          nullptr,
          x);
    }
  }
  ceres::Solver::Options options;
  if (!way.is_default) options.linear_solver_type = ceres::DENSE_QR;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  fit->x = Eigen::Vector3d(x);
  if (!way.has_covariance) return;
  ceres::Covariance::Options covariance_options;
  covariance_options.algorithm_type = ceres::DENSE_SVD;
  ceres::Covariance covariance(covariance_options);
  const std::vector<std::pair<const double*, const double*>> blocks = {{x, x}};
  if (covariance.Compute(blocks, &problem)) {
    // Symmetric, so that the order of rows and columns does not matter.
    covariance.GetCovarianceBlock(x, x, fit->covariance.data());
  }
}

void SolveByTinySolver(const Decay& decay, int k, FitResult<3>* fit) {
  using Function =
      ceres::TinySolverAutoDiffFunction<DecayBlock, Eigen::Dynamic, 3>;
  const DecayBlock block{decay, k, 0, decay.num_points};
  const Function function(block);
  ceres::TinySolver<Function> solver;
  fit->x = kStart;
  solver.Solve(function, &fit->x);
}

void SolveByFitMany(const Decay& decay, Fits* fits) {
  const int num_threads = 1;
  // [fit_many]
  FitOptions options;
  options.num_threads = num_threads;
  for (FitResult<3>& fit : *fits) fit.x = kStart;
  const std::vector<int> num_rows(fits->size(), decay.num_points);
  FitMany(options, decay, num_rows, fits);
  // [/fit_many]
}

using SolveAll = std::function<void(const Decay& decay, Fits* fits)>;

// By the fit of one data set.
template <typename SolveOne>
SolveAll ForEach(SolveOne solve) {
  return [solve](const Decay& decay, Fits* fits) {
    for (int k = 0; k < kFits; ++k) solve(decay, k, &(*fits)[k]);
  };
}

void Add(int num_points, const std::string& method, const SolveAll& solve) {
  const std::string prefix = fmt::format("fits/many_{}/", num_points);
  AddBenchmark(prefix + method,
               method == "fit_many" ? "" : prefix + "fit_many",
               [=](benchmark::State& state) {
                 const ManyData data(num_points);
                 const Decay decay{data.t.data(), data.y.data(), num_points};
                 Fits fits(kFits);
                 for (auto _ : state) solve(decay, &fits);
               });
}

}  // namespace

bool AddManyFitsBenchmarks(std::string* /*error*/) {
  const auto ceres = [](const CeresWay& way) {
    return ForEach([way](const Decay& decay, int k, FitResult<3>* fit) {
      SolveByCeres(way, decay, k, fit);
    });
  };
  for (const int num_points : {10, 30, 100}) {
    Add(num_points, "fit_many", SolveByFitMany);
    Add(num_points, "ceres", ceres({true, true, false}));
    Add(num_points, "ceres_qr", ceres({false, true, false}));
    Add(num_points, "ceres_qr_covariance", ceres({false, true, true}));
    Add(num_points, "ceres_block", ceres({false, false, false}));
    Add(num_points, "ceres_block_covariance", ceres({false, false, true}));
    Add(num_points, "tiny_solver", ForEach(SolveByTinySolver));
  }
  return true;
}

}  // namespace invgrad
