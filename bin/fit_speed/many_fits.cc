#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "bin/fit_speed/fit_parts.h"
#include "ceres/autodiff_cost_function.h"
#include "ceres/covariance.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "ceres/tiny_solver.h"
#include "ceres/tiny_solver_autodiff_function.h"
#include "fmt/core.h"
#include "invgrad/core/parallel.h"
#include "invgrad/fit/fit_many.h"
#include "invgrad/io/numpy_random.h"
#include "report/table.h"

namespace invgrad {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct ManyData {
  std::vector<double> t;
  std::vector<double> y;  // of one data set after the other

  explicit ManyData(int num_fits) {
    NumpyRandom random(1);
    for (int i = 0; i < FLAGS_points; ++i) t.push_back(3.0 * i / FLAGS_points);
    for (int k = 0; k < num_fits; ++k) {
      const double a = random.Uniform(1.0, 5.0);
      const double b = random.Uniform(0.5, 2.5);
      const double c = random.Uniform(0.0, 1.0);
      const Eigen::VectorXd noise = random.Normal(FLAGS_points);
      for (int i = 0; i < FLAGS_points; ++i) {
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

void ForFits(int num_fits,
             int num_threads,
             const std::function<void(int k)>& fit) {
  const auto fit_share = [&](int begin, int end) {
    for (int k = begin; k < end; ++k) fit(k);
    return end;
  };
  ForShares(num_fits, num_threads, fit_share, 1);
}

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

// A way to fit all data sets of a chunk.
struct ManyWay {
  std::string name;
  std::string covariance;
  std::function<void(const Decay& decay, int num_threads, Fits* fits)> solve;
  double seconds[2] = {0.0, 0.0};  // by 1 and by --threads
  double x_difference = 0.0;       // the largest, from FitMany
  double covariance_difference = 0.0;
};

std::vector<ManyWay> ManyWays() {
  std::vector<ManyWay> ways;
  const auto add_ceres = [&](const std::string& name, const CeresWay& way) {
    const auto solve = [way](const Decay& decay, int num_threads, Fits* fits) {
      ForFits(static_cast<int>(fits->size()), num_threads, [&](int k) {
        SolveByCeres(way, decay, k, &(*fits)[k]);
      });
    };
    ways.push_back({"ceres::Solve, " + name,
                    way.has_covariance ? "ceres::Covariance" : "-",
                    solve});
  };
  add_ceres("a block a point, default options", {true, true, false});
  add_ceres("a block a point, DENSE_QR", {false, true, false});
  add_ceres("a block a point, DENSE_QR", {false, true, true});
  add_ceres("one block, DENSE_QR", {false, false, false});
  add_ceres("one block, DENSE_QR", {false, false, true});
  const auto tiny = [](const Decay& decay, int num_threads, Fits* fits) {
    ForFits(static_cast<int>(fits->size()), num_threads, [&](int k) {
      SolveByTinySolver(decay, k, &(*fits)[k]);
    });
  };
  ways.push_back({"ceres::TinySolver", "-", tiny});
  const auto ours = [](const Decay& decay, int num_threads, Fits* fits) {
    // [fit_many]
    FitOptions options;
    options.num_threads = num_threads;
    for (FitResult<3>& fit : *fits) fit.x = kStart;
    const std::vector<int> num_rows(fits->size(), decay.num_points);
    FitMany(options, decay, num_rows, fits);
    // [/fit_many]
  };
  ways.push_back({"FitMany", "yes", ours});
  return ways;
}

}  // namespace

void CompareManyFits(RunCounts* counts) {
  // Chunks are short, so that what else the machine does meets all ways alike.
  constexpr int kChunk = 1000;
  const ManyData data(FLAGS_fits);
  std::vector<ManyWay> ways = ManyWays();
  const int num_threads[2] = {1, FLAGS_threads};
  int num_converged = 0;
  int num_of_full_rank = 0;
  int num_iterations = 0;
  for (int first = 0; first < FLAGS_fits; first += kChunk) {
    const Decay decay{data.t.data(),
                      &data.y[static_cast<size_t>(first) * FLAGS_points],
                      FLAGS_points};
    const int num_fits = std::min(kChunk, FLAGS_fits - first);
    std::vector<Fits> fits(ways.size(), Fits(num_fits));
    std::vector<double> least(2 * ways.size(), kInfinity);
    for (int i = 0; i < FLAGS_repetitions; ++i) {
      for (size_t j = 0; j < least.size(); ++j) {
        const auto solve = [&] {
          ways[j / 2].solve(decay, num_threads[j % 2], &fits[j / 2]);
        };
        least[j] = std::min(least[j], Seconds(solve));
      }
    }
    for (size_t j = 0; j < least.size(); ++j) {
      ways[j / 2].seconds[j % 2] += least[j];
    }
    for (int k = 0; k < num_fits; ++k) {
      const FitResult<3>& fit = fits.back()[k];
      for (size_t j = 0; j < ways.size(); ++j) {
        const FitResult<3>& other = fits[j][k];
        ways[j].x_difference = std::max(
            ways[j].x_difference, (other.x - fit.x).norm() / fit.x.norm());
        // Not a number where a way has none.
        ways[j].covariance_difference = std::max(
            ways[j].covariance_difference,
            (other.covariance - fit.covariance).norm() / fit.covariance.norm());
      }
      counts->Add(fit.status != FitStatus::kInvalidStart);
      num_converged += fit.IsConverged() ? 1 : 0;
      num_of_full_rank += fit.rank == 3 ? 1 : 0;
      num_iterations += fit.num_iterations;
    }
  }
  const ManyWay& ours = ways.back();
  Table table({{fmt::format("{} fits to {} points", FLAGS_fits, FLAGS_points),
                Table::Align::kLeft},
               {"covariance", Table::Align::kLeft},
               {"us a fit, 1 thread"},
               {"times FitMany"},
               {fmt::format("us a fit, {} threads", FLAGS_threads)},
               {"times FitMany"},
               {"difference of x"},
               {"of the covariance"}});
  for (const ManyWay& way : ways) {
    std::vector<std::string> cells = {way.name, way.covariance};
    for (int k = 0; k < 2; ++k) {
      cells.push_back(fmt::format("{:.2f}", 1e6 * way.seconds[k] / FLAGS_fits));
      cells.push_back(fmt::format("{:.1f}", way.seconds[k] / ours.seconds[k]));
    }
    cells.push_back(fmt::format("{:.0e}", way.x_difference));
    cells.push_back(way.covariance == "-"
                        ? "-"
                        : fmt::format("{:.0e}", way.covariance_difference));
    table.AddRow(cells);
  }
  std::cout << table.ToMarkdown()
            << fmt::format(
                   "\nFitMany: {} converged, {} of rank 3, {:.1f} iterations "
                   "each\n\n",
                   num_converged,
                   num_of_full_rank,
                   1.0 * num_iterations / FLAGS_fits);
}

}  // namespace invgrad
