// starts/TERMS_AMPLITUDE/METHOD: fits of a sum of exponentials c_j exp(-a_j t) to
// 100 samples in [0, 10] of the sum with c_j = 1, a_j = 0.1 3^j and noise, from
// 1,000 random starts: c uniform in [0, AMPLITUDE], log a in log 0.03 ... log 30.
// An iteration of the benchmark is a start; its counters are the share of the
// starts that end in the best minimum, and the mean of the iterations.
//
//   separable       variable projection, Kaufman's Jacobian
//   golub_pereyra   the same with the whole Jacobian
//   separable_half  with half-inverse proposals
//   lm              over all parameters
//   lm_half         the same with half-inverse proposals
//   lm_linear       over all parameters, the amplitudes of the start by least
//                   squares

#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "benchmark/benchmark.h"
#include "bin/bench/bench.h"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/method.h"
#include "invgrad/minimize/method_minimization.h"
#include "invgrad/random.h"
#include "invgrad/separable.h"

namespace invgrad {
namespace {

constexpr int kStarts = 1000;
constexpr int kSamples = 100;
constexpr double kLastTime = 10.0;
constexpr double kNoise = 1e-4;  // of a sample
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

struct Way {
  std::string name;
  std::string method;
  bool is_separable = false;
  bool has_linear_start = false;  // c(a) in place of random amplitudes
  bool is_golub_pereyra = false;
};

MinimizerOptions Budget() {
  MinimizerOptions options;
  options.max_num_iterations = 500;
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.gradient_tolerance = 1e-14;
  return options;
}

// The cost where the run ends; infinite: it fails.
template <int p>
double Minimize(const Sum<p>& sum,
                const Eigen::VectorXd& start,  // c, a
                const Way& way,
                double* num_iterations) {
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
  CHECK(ParseMethod(way.method, &method, &error)) << error;
  method.AddCeresDefaults({{"linear_solver", "dense_qr"}});
  std::unique_ptr<SeparableProblem> separable;
  MinimizerSummary summary;
  constexpr double kFails = std::numeric_limits<double>::infinity();
  if (way.is_separable || way.has_linear_start) {
    SeparableProblem::Options options;
    options.is_golub_pereyra = way.is_golub_pereyra;
    separable =
        SeparableProblem::Create(options, {{c.data(), {}}}, &problem, &error);
    if (separable == nullptr || !separable->SolveLinear(&error)) return kFails;
  }
  if (!MinimizeProblem(method,
                       Budget(),
                       nullptr,
                       way.is_separable ? separable->reduced() : &problem,
                       &summary,
                       &error)) {
    return kFails;
  }
  *num_iterations += summary.num_steps();
  const bool is_solved =
      std::isfinite(summary.final_cost) && summary.final_cost >= 0.0;
  return is_solved ? summary.final_cost : kFails;
}

template <int p>
void Measure(double amplitude, const Way& way, benchmark::State* state) {
  NumpyRandom random(p);
  const Eigen::VectorXd t =
      Eigen::VectorXd::LinSpaced(kSamples, 0.0, kLastTime);
  Eigen::VectorXd y = kNoise * random.Normal(kSamples);
  Eigen::VectorXd truth = Eigen::VectorXd::Ones(2 * p);
  for (int j = 0; j < p; ++j) {
    truth[p + j] = 0.1 * std::pow(3.0, j);
    y.array() += (-truth[p + j] * t.array()).exp();
  }
  const Sum<p> sum{t, y};
  double ignored = 0.0;
  const double best = Minimize(sum, truth, {"", "ceres_lm", true}, &ignored);
  double num_best = 0.0, num_iterations = 0.0;
  for (auto _ : *state) {
    Eigen::VectorXd start(2 * p);
    for (int j = 0; j < p; ++j) {
      start[j] = random.Uniform(0.0, amplitude);
      start[p + j] = 0.03 * std::pow(1000.0, random.Rand());
    }
    const double cost = Minimize(sum, start, way, &num_iterations);
    num_best += cost <= best * (1.0 + kSameCost) ? 1.0 : 0.0;
  }
  state->counters["best_%"] = 100.0 * num_best / kStarts;
  state->counters["iterations"] = num_iterations / kStarts;
}

template <int p>
void Add(int amplitude) {
  const std::string half = "ceres_lm+half_inverse:step_size=auto:rho=1";
  const std::string prefix = fmt::format("starts/{}_{}/", p, amplitude);
  for (const Way& way : {Way{"separable", "ceres_lm", true},
                         Way{"golub_pereyra", "ceres_lm", true, false, true},
                         Way{"separable_half", half, true},
                         Way{"lm", "ceres_lm"},
                         Way{"lm_half", half},
                         Way{"lm_linear", "ceres_lm", false, true}}) {
    AddBenchmark(prefix + way.name,
                 way.name == "separable" ? "" : prefix + "separable",
                 [=](auto& state) { Measure<p>(amplitude, way, &state); })
        ->Iterations(kStarts);
  }
}

}  // namespace

bool AddExponentialsBenchmarks(std::string* /*error*/) {
  for (const int amplitude : {2, 100}) {
    Add<2>(amplitude);
    Add<3>(amplitude);
    Add<4>(amplitude);
    Add<5>(amplitude);
  }
  return true;
}

}  // namespace invgrad
