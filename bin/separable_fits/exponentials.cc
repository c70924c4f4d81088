#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "bin/separable_fits/parts.h"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/io/format.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/methods/method.h"
#include "invgrad/minimize/method_minimization.h"
#include "invgrad/separable/separable_problem.h"
#include "report/table.h"

namespace invgrad {
namespace {

constexpr int kSamples = 100;
constexpr double kLastTime = 10.0;
// A minimum is the best one up to this relative difference of the cost.
constexpr double kSameCost = 1e-4;

// r_i = sum_j c_j exp(-a_j t_i) - y_i
template <int p>
struct Sum {
  const Eigen::VectorXd& t;
  const Eigen::VectorXd& y;

  template <typename T>
  bool operator()(const T* c, const T* a, T* r) const {
    using std::exp;
    for (Eigen::Index i = 0; i < t.size(); ++i) {
      r[i] = T(-y[i]);
      for (int j = 0; j < p; ++j) r[i] += c[j] * exp(-a[j] * t[i]);
    }
    return true;
  }
};

// A way to minimize from a start.
struct ExponentialWay {
  std::string name;
  std::string method;
  bool is_separable = false;
  bool has_linear_start = false;  // c(a) in place of random amplitudes
  bool is_golub_pereyra = false;
  // Of all starts.
  std::vector<double> costs = {};
  double num_iterations = 0.0;
  double seconds = 0.0;
};

std::vector<ExponentialWay> ExponentialWays() {
  const std::string half = "ceres_lm+half_inverse:step_size=auto:rho=1";
  return {
      {"LM", "ceres_lm"},
      {"LM with half-inverse proposals", half},
      {"LM, amplitudes of the start by least squares", "ceres_lm", false, true},
      {"variable projection, Kaufman", "ceres_lm", true},
      {"variable projection, Golub-Pereyra", "ceres_lm", true, false, true},
      {"variable projection with half-inverse proposals", half, true}};
}

MinimizerOptions Budget() {
  MinimizerOptions options;
  options.max_num_iterations = 500;
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.gradient_tolerance = 1e-14;
  return options;
}

// One run; infinite cost: it fails.
template <int p>
void RunWay(const Sum<p>& sum,
            const Eigen::VectorXd& start,  // c, a
            ExponentialWay* way) {
  Eigen::VectorXd c = start.head(p);
  Eigen::VectorXd a = start.tail(p);
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Sum<p>, ceres::DYNAMIC, p, p>(
          new Sum<p>(sum), kSamples),
      nullptr,
      c.data(),
      a.data());
  Method method;
  std::string error;
  CHECK(ParseMethod(way->method, &method, &error)) << error;
  method.AddCeresDefaults({{"linear_solver", "dense_qr"}});
  std::unique_ptr<SeparableProblem> separable;
  MinimizerSummary summary;
  way->costs.push_back(std::numeric_limits<double>::infinity());
  if (way->is_separable || way->has_linear_start) {
    SeparableProblem::Options options;
    options.is_golub_pereyra = way->is_golub_pereyra;
    separable =
        SeparableProblem::Create(options, {{c.data(), {}}}, &problem, &error);
    if (separable == nullptr || !separable->SolveLinear(&error)) return;
  }
  if (!MinimizeProblem(method,
                       Budget(),
                       nullptr,
                       way->is_separable ? separable->reduced() : &problem,
                       &summary,
                       &error)) {
    return;
  }
  way->num_iterations += summary.num_steps();
  way->seconds += summary.total_time_in_seconds;
  const bool is_solved =
      std::isfinite(summary.final_cost) && summary.final_cost >= 0.0;
  if (is_solved) way->costs.back() = summary.final_cost;
}

template <int p>
void CompareSums(RunCounts* counts, Table* table) {
  NumpyRandom random(p);
  const Eigen::VectorXd t =
      Eigen::VectorXd::LinSpaced(kSamples, 0.0, kLastTime);
  Eigen::VectorXd y = FLAGS_noise * random.Normal(kSamples);
  for (int j = 0; j < p; ++j) {
    y.array() += (-0.1 * std::pow(3.0, j) * t.array()).exp();
  }
  const Sum<p> sum{t, y};
  std::vector<ExponentialWay> ways = ExponentialWays();
  for (int k = 0; k < FLAGS_starts; ++k) {
    Eigen::VectorXd start(2 * p);
    for (int j = 0; j < p; ++j) {
      start[j] = random.Uniform(0.0, FLAGS_amplitude);
      start[p + j] = 0.03 * std::pow(1000.0, random.Rand());
    }
    for (ExponentialWay& way : ways) RunWay<p>(sum, start, &way);
  }
  double best = std::numeric_limits<double>::infinity();
  for (const ExponentialWay& way : ways) {
    best =
        std::min(best, *std::min_element(way.costs.begin(), way.costs.end()));
  }
  for (const ExponentialWay& way : ways) {
    const auto num_best =
        std::count_if(way.costs.begin(), way.costs.end(), [&](double cost) {
          return cost <= best * (1.0 + kSameCost);
        });
    counts->Add(num_best > 0);
    table->BeginRow();
    table->Add("terms", std::to_string(p));
    table->Add("way", way.name, Table::Align::kLeft);
    table->Add("best minimum [%]",
               fmt::format("{:.1f}", 100.0 * num_best / FLAGS_starts));
    table->Add("iterations",
               fmt::format("{:.1f}", way.num_iterations / FLAGS_starts));
    table->Add("ms", FormatNumber(1e3 * way.seconds / FLAGS_starts, 3));
    table->Add(
        "ms for a best minimum",
        num_best == 0 ? "-" : FormatNumber(1e3 * way.seconds / num_best, 3));
    table->Add("best cost", FormatNumber(best, 5));
  }
}

}  // namespace

bool CompareExponentials(RunCounts* counts, std::string* error) {
  const std::vector<std::string> all_terms = SplitList(FLAGS_terms);
  bool is_valid = !all_terms.empty();
  for (const std::string& terms : all_terms) {
    is_valid =
        is_valid && terms.size() == 1 && terms[0] >= '2' && terms[0] <= '5';
  }
  if (!is_valid) {
    *error = "--terms=" + FLAGS_terms + ": allowed are 2, 3, 4 and 5";
    return false;
  }
  Table table;
  for (const std::string& terms : all_terms) {
    if (terms == "2") CompareSums<2>(counts, &table);
    if (terms == "3") CompareSums<3>(counts, &table);
    if (terms == "4") CompareSums<4>(counts, &table);
    if (terms == "5") CompareSums<5>(counts, &table);
  }
  std::cout << table.ToMarkdown() << "\n";
  return true;
}

}  // namespace invgrad
