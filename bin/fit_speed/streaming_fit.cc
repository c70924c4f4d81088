#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <iostream>
#include <limits>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "bin/fit_speed/fit_parts.h"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "fmt/core.h"
#include "invgrad/fit/fit_streaming.h"
#include "report/table.h"

namespace invgrad {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

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

}  // namespace

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

}  // namespace invgrad
