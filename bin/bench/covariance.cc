// covariance/FILE/METHOD: for bundle adjustments and pose graphs, at their
// solutions, the files of --input.
//
//   ours           ComputeCovariance of all poses, or all cameras
//   ceres          ceres::Covariance of the same blocks, SPARSE_QR
//   lm_iteration   an iteration of Ceres' Levenberg-Marquardt, the mean over a
//                  minimization, with the solver that `estimate` chooses
//
// The label of `ceres` is the largest relative difference of a standard
// deviation.

#include "ceres/covariance.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "benchmark/benchmark.h"
#include "bin/bench/bench.h"
#include "bin/support/program.h"
#include "ceres/problem.h"
#include "fmt/core.h"
#include "invgrad/covariance.h"
#include "invgrad/method.h"
#include "invgrad/minimize/method_minimization.h"
#include "problems/estimation/estimation.h"

namespace invgrad {
namespace {

struct Solution {
  std::string file;
  std::unique_ptr<Estimation> estimation;
  std::unique_ptr<ceres::Problem> problem;
  std::vector<Covariance::Pair> pairs;
  double seconds_of_iteration = 0.0;
};

bool Solve(Solution* solution, std::string* error) {
  Estimation* estimation = solution->estimation.get();
  std::vector<Method> methods;
  if (!ParseMethods("ceres_lm", &methods, error)) return false;
  Method& method = methods.front();
  method.AddCeresDefaults(
      {{"linear_solver", estimation->traits().linear_solver}});
  MinimizerSummary summary;
  if (!MinimizeProblem(method,
                       estimation->traits().budget,
                       estimation->MakeOrdering(),
                       solution->problem.get(),
                       &summary,
                       error)) {
    return false;
  }
  double sum = 0.0;
  for (int i = 1; i <= summary.num_steps(); ++i) {
    sum += summary.iterations[i].iteration_time_in_seconds;
  }
  solution->seconds_of_iteration = sum / std::max(1, summary.num_steps());
  return true;
}

// The solution of a file, or null, with *error; the last one is kept.
const Solution* SolutionOf(const std::string& file, std::string* error) {
  static auto& last = *new Solution;
  if (last.file == file) return &last;
  last = Solution();
  last.estimation = ReadEstimation(file, ReadEstimationOptions(), error);
  if (last.estimation == nullptr) return nullptr;
  last.estimation->SetStart(0);
  last.problem = last.estimation->MakeProblem([]() { return nullptr; });
  if (!Solve(&last, error)) return nullptr;
  last.pairs = last.estimation->CovariancePairs(*last.problem);
  last.file = file;
  return &last;
}

// The largest relative difference of a standard deviation.
double Difference(const Covariance& covariance,
                  const ceres::Covariance& expected,
                  const Solution& at) {
  double difference = 0.0;
  for (const auto& [a, b] : at.pairs) {
    const int size = at.problem->ParameterBlockTangentSize(a);
    Eigen::MatrixXd C(size, size);  // symmetric
    expected.GetCovarianceBlockInTangentSpace(a, b, C.data());
    const Eigen::ArrayXd deviations = C.diagonal().array().sqrt();
    difference = std::max(
        difference,
        (covariance.block(a).standard_deviations.array() / deviations - 1.0)
            .abs()
            .maxCoeff());
  }
  return difference;
}

void MeasureOurs(const std::string& file, benchmark::State& state) {
  std::string error;
  const Solution* at = SolutionOf(file, &error);
  Covariance covariance;
  for (auto _ : state) {
    if (at == nullptr ||
        !ComputeCovariance({}, *at->problem, at->pairs, &covariance, &error)) {
      state.SkipWithError(error.c_str());
      return;
    }
  }
  state.SetLabel(fmt::format("rank {} of {}, {} blocks",
                             covariance.rank(),
                             covariance.num_parameters(),
                             at->pairs.size()));
}

void MeasureCeres(const std::string& file, benchmark::State& state) {
  std::string error;
  const Solution* at = SolutionOf(file, &error);
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::SPARSE_QR;
  ceres::Covariance expected(options);
  for (auto _ : state) {
    if (at == nullptr || !expected.Compute(at->pairs, at->problem.get())) {
      state.SkipWithError(("ceres::Covariance fails" + error).c_str());
      return;
    }
  }
  Covariance covariance;
  if (ComputeCovariance({}, *at->problem, at->pairs, &covariance, &error)) {
    state.SetLabel(fmt::format("difference {:.0e}",
                               Difference(covariance, expected, *at)));
  }
}

void MeasureIteration(const std::string& file, benchmark::State& state) {
  std::string error;
  const Solution* at = SolutionOf(file, &error);
  for (auto _ : state) {
    if (at == nullptr) {
      state.SkipWithError(error.c_str());
      return;
    }
    state.SetIterationTime(at->seconds_of_iteration);
  }
}

}  // namespace

bool AddCovarianceBenchmarks(std::string* /*error*/) {
  for (const std::string& file : SplitList(FLAGS_input)) {
    const std::string prefix =
        "covariance/" + std::filesystem::path(file).stem().string() + "/";
    AddBenchmark(prefix + "lm_iteration",
                 "",
                 [file](auto& state) { MeasureIteration(file, state); })
        ->UseManualTime()
        ->Iterations(1);
    AddBenchmark(prefix + "ours", prefix + "lm_iteration", [file](auto& state) {
      MeasureOurs(file, state);
    });
    AddBenchmark(prefix + "ceres", prefix + "ours", [file](auto& state) {
      MeasureCeres(file, state);
    });
  }
  return true;
}

}  // namespace invgrad
