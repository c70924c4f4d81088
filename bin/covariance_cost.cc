/*
Compares the time of ComputeCovariance with that of an iteration of Ceres'
Levenberg-Marquardt, and with that of ceres::Covariance, at the solution of
bundle adjustments and pose graphs.

Sample runs:

  covariance_cost --input=M3500.g2o,sphere2500.g2o
  covariance_cost --input=problem-16-22106-pre.txt.bz2 --ceres=false

Prints a table: seconds of one LM iteration (the mean, with the solver that
`estimate` chooses) and of the covariances of all poses, or all cameras (the
least of three), of ceres::Covariance for the same blocks (SPARSE_QR), their
ratios, and the largest relative difference of a standard deviation.
*/

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "bin/support/program.h"
#include "ceres/covariance.h"
#include "ceres/problem.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/covariance/covariance.h"
#include "invgrad/io/format.h"
#include "invgrad/methods/method.h"
#include "invgrad/minimize/method_minimization.h"
#include "problems/estimation/estimation.h"
#include "report/table.h"

DEFINE_string(input, "", "files that estimate reads, comma-separated");
DEFINE_bool(ceres, true, "run ceres::Covariance, too");

namespace invgrad {
namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Moves the estimation to its solution; returns the seconds of an iteration.
bool Solve(Estimation* estimation,
           ceres::Problem* problem,
           double* seconds,
           std::string* error) {
  std::vector<Method> methods;
  if (!ParseMethods("ceres_lm", &methods, error)) return false;
  Method& method = methods.front();
  method.AddCeresDefaults(
      {{"linear_solver", estimation->traits().linear_solver}});
  MinimizerSummary summary;
  if (!MinimizeProblem(method,
                       estimation->traits().budget,
                       estimation->MakeOrdering(),
                       problem,
                       &summary,
                       error)) {
    return false;
  }
  double sum = 0.0;
  for (int i = 1; i <= summary.num_steps(); ++i) {
    sum += summary.iterations[i].iteration_time_in_seconds;
  }
  *seconds = sum / std::max(1, summary.num_steps());
  return true;
}

// The largest relative difference of a standard deviation; none where Ceres
// fails.
bool CompareWithCeres(const Covariance& covariance,
                      const std::vector<Covariance::Pair>& pairs,
                      ceres::Problem* problem,
                      double* seconds,
                      double* difference) {
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::SPARSE_QR;
  ceres::Covariance expected(options);
  const Clock::time_point start = Clock::now();
  const bool is_computed = expected.Compute(pairs, problem);
  *seconds = SecondsSince(start);
  *difference = 0.0;
  for (const auto& [a, b] : pairs) {
    if (!is_computed) break;
    const int size = problem->ParameterBlockTangentSize(a);
    Eigen::MatrixXd C(size, size);  // symmetric
    if (!expected.GetCovarianceBlockInTangentSpace(a, b, C.data())) {
      return false;
    }
    const Eigen::ArrayXd deviations = C.diagonal().array().sqrt();
    *difference = std::max(
        *difference,
        (covariance.block(a).standard_deviations.array() / deviations - 1.0)
            .abs()
            .maxCoeff());
  }
  return is_computed;
}

bool AddRow(const std::string& file, Table* table, std::string* error) {
  const std::unique_ptr<Estimation> estimation =
      ReadEstimation(file, ReadEstimationOptions(), error);
  if (estimation == nullptr) return false;
  estimation->SetStart(0);
  const std::unique_ptr<ceres::Problem> problem =
      estimation->MakeProblem([]() { return nullptr; });
  double iteration = 0.0;
  if (!Solve(estimation.get(), problem.get(), &iteration, error)) return false;
  const std::vector<Covariance::Pair> pairs =
      estimation->CovariancePairs(*problem);
  Covariance covariance;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    const Clock::time_point start = Clock::now();
    if (!ComputeCovariance({}, *problem, pairs, &covariance, error)) {
      *error = file + ": " + *error;
      return false;
    }
    least = std::min(least, SecondsSince(start));
  }
  const size_t slash = file.find_last_of('/');
  table->BeginRow();
  table->Add("file",
             slash == std::string::npos ? file : file.substr(slash + 1),
             Table::Align::kLeft);
  table->Add(
      "rank",
      fmt::format("{} of {}", covariance.rank(), covariance.num_parameters()));
  table->Add("blocks", std::to_string(pairs.size()));
  table->Add("LM iteration [s]", FormatNumber(iteration, 3));
  table->Add("covariance [s]", FormatNumber(least, 3));
  table->Add("ratio", FormatNumber(least / iteration, 3));
  if (!FLAGS_ceres) return true;
  double seconds = 0.0;
  double difference = 0.0;
  const bool is_computed =
      CompareWithCeres(covariance, pairs, problem.get(), &seconds, &difference);
  table->Add("ceres::Covariance [s]", FormatNumber(seconds, 3));
  table->Add("its ratio to ours", FormatNumber(seconds / least, 3));
  table->Add("difference",
             is_computed ? FormatNumber(difference, 2) : "it fails");
  return true;
}

bool Run(RunCounts* counts, std::string* error) {
  if (FLAGS_input.empty()) {
    *error = "--input is missing: files, such as M3500.g2o";
    return false;
  }
  Table table;
  for (const std::string& file : SplitList(FLAGS_input)) {
    if (!AddRow(file, &table, error)) return NameFlag("input", false, error);
    counts->Add(true);
  }
  std::cout << table.ToText();
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(
      argc,
      argv,
      "compares the time of ComputeCovariance with an LM iteration and with "
      "ceres::Covariance\n\n"
      "  covariance_cost --input=M3500.g2o,sphere2500.g2o",
      invgrad::Run);
}
