/*
Compares the fits of lib/invgrad/fit with ceres::Solve, as ratios within one
run.

Sample runs:

  fit_speed
  fit_speed --part=many --points=10
  fit_speed --part=streaming --rows=1000000 --repetitions=1

many       --fits fits of a exp(-b t) + c to --points points, by the same
           functor, starts and tolerances, in chunks of 1,000 which alternate.
           Ceres has a new problem for each data set, and a residual block for
           each point, as in its example curve_fitting.cc, or one for all
           points, which is faster. For the covariance it has DENSE_SVD, which
           alone allows for rank deficiency.
streaming  one fit of five sines, 10 parameters, to --rows points; a
           ceres::Problem has a tenth of them. Each fit has a process of its
           own; its peak memory is above that of the data.
factor     the triangular factor R of streaming_gram.h and the normal equations
           of 10 columns that nearly agree: errors of a step, and times.

Times are the smallest of --repetitions, and differences the largest.
*/

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iostream>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Cholesky"
#include "Eigen/Core"
#include "bin/support/program.h"
#include "ceres/autodiff_cost_function.h"
#include "ceres/covariance.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "ceres/tiny_solver.h"
#include "ceres/tiny_solver_autodiff_function.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/core/parallel.h"
#include "invgrad/fit/fit_many.h"
#include "invgrad/fit/fit_streaming.h"
#include "invgrad/io/numpy_random.h"
#include "report/table.h"

DEFINE_string(part, "all", "all, many, streaming or factor");
DEFINE_int32(fits, 100000, "data sets");
DEFINE_int32(points, 30, "of a data set");
DEFINE_int32(rows, 10000000, "of the streaming fit");
DEFINE_int32(threads, 2, "of the columns that name them");
DEFINE_int32(repetitions, 3, "of each time");

namespace invgrad {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double Seconds(const std::function<void()>& work) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point start = Clock::now();
  work();
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// --- Many small fits ---

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

// --- One fit of very many rows ---

constexpr int kParameters = 10;
using SinesState = Eigen::Matrix<double, kParameters, 1>;

// In [0, 2 pi), whatever the number of rows.
double Time(int i) {
  constexpr double kGolden = 0.61803398874989485;
  return 6.283185307179586 * (kGolden * i - std::floor(kGolden * i));
}

// [sines]
// y = sum of a sin(w t), with amplitudes a and frequencies w unknown.
struct Sines {
  const float* y;

  template <typename T>
  bool operator()(int i, const T* x, T* residual) const {
    using std::sin;
    *residual = T(-y[i]);
    for (int j = 0; j < kParameters; j += 2) {
      *residual += x[j] * sin(x[j + 1] * Time(i));
    }
    return true;
  }
};
// [/sines]

SinesState TrueSines() {
  SinesState x;
  x << 1.0, 1.0, 0.8, 2.1, 0.6, 3.3, 0.5, 4.2, 0.3, 5.4;
  return x;
}

// With an error of +-0.1 that looks random.
std::vector<float> SinesData(int num_rows) {
  const SinesState x = TrueSines();
  std::vector<float> y(num_rows, 0.0F);
  for (int i = 0; i < num_rows; ++i) {
    double value;
    Sines{y.data()}(i, x.data(), &value);
    uint32_t bits = static_cast<uint32_t>(i) * 2654435761U;
    bits = (bits ^ (bits >> 15)) * 2246822519U;
    y[i] = static_cast<float>(value + (bits >> 31 != 0 ? 0.1 : -0.1));
  }
  return y;
}

template <int kRows>
struct SinesBlock {
  Sines sines;
  int begin;

  template <typename T>
  bool operator()(const T* x, T* residuals) const {
    for (int i = 0; i < kRows; ++i) sines(begin + i, x, &residuals[i]);
    return true;
  }
};

// What the process of one fit reports.
struct StreamingRun {
  double seconds = kInfinity;
  double megabytes = 0.0;  // above those of the data
  int num_iterations = 0;
  SinesState x;  // the start before
};

void FitSines(int num_threads, int num_rows, Sines sines, StreamingRun* run) {
  // [fit_streaming]
  FitOptions options;
  options.num_threads = num_threads;
  FitResult<kParameters> fit;
  fit.x = run->x;
  FitStreaming(options, num_rows, sines, &fit);
  // [/fit_streaming]
  run->x = fit.x;
  run->num_iterations = fit.num_iterations;
}

template <int kRows>
void SolveSines(int num_threads, int num_rows, Sines sines, StreamingRun* run) {
  ceres::Problem problem;
  for (int begin = 0; begin + kRows <= num_rows; begin += kRows) {
    using Block = SinesBlock<kRows>;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Block, kRows, kParameters>(
            new Block{sines, begin}),
        nullptr,
        run->x.data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.num_threads = num_threads;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  // The first entry is the start; the step that converges is not listed.
  run->num_iterations = static_cast<int>(summary.iterations.size());
}

double PeakMegabytes() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

using SinesFit = void (*)(int, int, Sines, StreamingRun*);

// In a process of its own, so that the peak is that of the fit.
bool RunAlone(int num_threads, int num_rows, SinesFit fit, StreamingRun* run) {
  int ends[2];
  if (pipe(ends) != 0) return false;
  std::cout.flush();
  const pid_t child = fork();
  if (child == 0) {
    const std::vector<float> y = SinesData(num_rows);
    const double before = PeakMegabytes();
    StreamingRun result;
    result.x = TrueSines().array() + 0.05;
    result.seconds =
        Seconds([&] { fit(num_threads, num_rows, {y.data()}, &result); });
    result.megabytes = PeakMegabytes() - before;
    const bool is_written =
        write(ends[1], &result, sizeof(result)) == sizeof(result);
    _exit(is_written ? 0 : 1);
  }
  close(ends[1]);
  const bool is_read = read(ends[0], run, sizeof(*run)) == sizeof(*run);
  close(ends[0]);
  int status = 1;
  if (child > 0) waitpid(child, &status, 0);
  return is_read && status == 0;
}

bool CompareStreamingFits(RunCounts* counts, std::string* error) {
  struct Way {
    std::string name;
    SinesFit fit;
    int num_rows;
    int num_threads;
    StreamingRun run;
  };
  const int ceres_rows = FLAGS_rows / 10;
  std::vector<Way> ways;
  for (const int num_threads : {1, FLAGS_threads}) {
    ways.push_back({"ceres::Solve, a block a row",
                    SolveSines<1>,
                    ceres_rows,
                    num_threads,
                    {}});
    ways.push_back({"ceres::Solve, blocks of 50 rows",
                    SolveSines<50>,
                    ceres_rows,
                    num_threads,
                    {}});
    ways.push_back({"FitStreaming", FitSines, ceres_rows, num_threads, {}});
    ways.push_back({"FitStreaming", FitSines, FLAGS_rows, num_threads, {}});
  }
  for (int i = 0; i < FLAGS_repetitions; ++i) {
    for (Way& way : ways) {
      StreamingRun run;
      if (!RunAlone(way.num_threads, way.num_rows, way.fit, &run)) {
        *error = way.name + " has not ended";
        return false;
      }
      if (run.seconds < way.run.seconds) way.run = run;
    }
  }
  Table table({{"10 parameters", Table::Align::kLeft},
               {"rows"},
               {"threads"},
               {"s"},
               {"iterations"},
               {"ns a row and iteration"},
               {"MB above the data"},
               {"largest error of x"}});
  for (const Way& way : ways) {
    const double evaluations =
        static_cast<double>(way.num_rows) * (way.run.num_iterations + 1);
    table.AddRow(
        {way.name,
         fmt::format("{}", way.num_rows),
         fmt::format("{}", way.num_threads),
         fmt::format("{:.2f}", way.run.seconds),
         fmt::format("{}", way.run.num_iterations),
         fmt::format("{:.0f}", 1e9 * way.run.seconds / evaluations),
         fmt::format("{:.1f}", way.run.megabytes),
         fmt::format("{:.1e}",
                     (way.run.x - TrueSines()).cwiseAbs().maxCoeff())});
    counts->Add(true);
  }
  std::cout << table.ToMarkdown() << "\n";
  return true;
}

// --- The factor against the normal equations ---

// Columns 1 + e cos(pi j (i + 1/2) / rows), which agree but for e: the
// condition number is of order 1 / e.
void CompareFactors(RunCounts* counts) {
  constexpr int kRows = 10000;
  constexpr int kColumns = kParameters;
  Table table({{"e"},
               {"error by R"},
               {"error by J^T J"},
               {"ns a row, R"},
               {"ns a row, J^T J"}});
  for (const double e : {1.0, 1e-2, 1e-4, 1e-6, 1e-8}) {
    Eigen::MatrixXd J_transposed(kColumns, kRows);
    for (int i = 0; i < kRows; ++i) {
      for (int j = 0; j < kColumns; ++j) {
        constexpr double kPi = 3.14159265358979323846;
        J_transposed(j, i) = 1.0 + e * std::cos(kPi * j * (i + 0.5) / kRows);
      }
    }
    // The step is one everywhere.
    const Eigen::VectorXd r = -J_transposed.colwise().sum();
    SinesState by_root;
    SinesState by_products;
    double seconds[2] = {kInfinity, kInfinity};
    for (int repetition = 0; repetition < FLAGS_repetitions; ++repetition) {
      const auto compute_root = [&] {
        // [gram]
        StreamingGram<kColumns> gram;
        for (int i = 0; i < kRows; ++i) {
          gram.AddRow(J_transposed.col(i).data(), r[i]);
        }
        const GramRoot<kColumns>& root = gram.Finish();
        by_root = -root.R.triangularView<Eigen::Upper>().solve(root.c);
        // [/gram]
      };
      const auto compute_products = [&] {
        using Matrix = Eigen::Matrix<double, kColumns, kColumns>;
        Matrix JtJ = Matrix::Zero();
        SinesState gradient = SinesState::Zero();
        for (int i = 0; i < kRows; ++i) {
          const SinesState row = J_transposed.col(i);
          JtJ += row * row.transpose();
          gradient += row * r[i];
        }
        by_products = -JtJ.ldlt().solve(gradient);
      };
      seconds[0] = std::min(seconds[0], Seconds(compute_root));
      seconds[1] = std::min(seconds[1], Seconds(compute_products));
    }
    const auto error = [](const SinesState& step) {
      return fmt::format("{:.0e}", (step.array() - 1.0).abs().maxCoeff());
    };
    table.AddRow({fmt::format("{:.0e}", e),
                  error(by_root),
                  error(by_products),
                  fmt::format("{:.1f}", 1e9 * seconds[0] / kRows),
                  fmt::format("{:.1f}", 1e9 * seconds[1] / kRows)});
    counts->Add(true);
  }
  std::cout << table.ToMarkdown();
}

bool Run(RunCounts* counts, std::string* error) {
  if (!CheckFlag("part", {"all", "many", "streaming", "factor"}, error) ||
      !CheckFlags({{"fits", {1, 1000000}},
                   {"points", {3, 1000}},
                   {"rows", {1000, 1000000000}},
                   {"threads", {1, 1000}},
                   {"repetitions", {1, 1000}}},
                  error)) {
    return false;
  }
  const auto has_part = [](const std::string& part) {
    return FLAGS_part == "all" || FLAGS_part == part;
  };
  // Processes first: they are copies of this one.
  if (has_part("streaming") && !CompareStreamingFits(counts, error)) {
    return false;
  }
  if (has_part("many")) CompareManyFits(counts);
  if (has_part("factor")) CompareFactors(counts);
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(argc,
                             argv,
                             "compares fits with ceres::Solve: very many small "
                             "ones, and one with very "
                             "many rows",
                             invgrad::Run);
}
