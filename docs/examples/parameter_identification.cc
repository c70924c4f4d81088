// Parameter identification: the rates of a predator and its prey, from noisy
// counts of both.
//
//   u' = alpha u - beta u v,   v' = delta u v - gamma v       (Lotka-Volterra)
//   L = 1/2 sum_i |log (u, v)(t_i) - log counts_i|^2 / noise^2
//
// Estimated:  the logarithms of alpha, beta, gamma, delta, u(0) and v(0). Rates
//             and counts are positive, and so need no bounds, with which
//             proposals do not work.
// Truth:      alpha = 1, beta = 0.1, gamma = 1.5, delta = 0.075 (1 / year and
//             1 / (year animal)), u(0) = 10, v(0) = 5 animals. A period is
//             about 5.5 years.
// Data:       counts every half year for 12 years, with a lognormal error of
//             10 %.
// Starts:     100 guesses: the first counts, and every rate off by a random
//             factor, lognormal with a standard deviation of e. The cost has
//             valleys where the phase has slipped by a period, or where one
//             species dies out; which start leads where depends on the steps.
// Simulation: classical Runge-Kutta (order 4) in steps of 0.05 years, inside
//             the functor: Ceres' Jets go through it.
// Expect:     two starts in five lead to the truth, by Levenberg-Marquardt with
//             Ceres' defaults, and a few more with half-inverse steps proposed,
//             but not the same ones. What helps more, from three starts in
//             five, is a first step that is not too long:
//             initial_trust_region_radius = 1 in place of 1e4.
//
// Exits with 0 if each solver's estimate of least cost is within a factor of
// 1 + kTolerance of the truth in every parameter.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "glog/logging.h"
#include "invgrad/ceres/update_callback.h"
#include "invgrad/io/numpy_generator.h"
#include "invgrad/rules/rules.h"

namespace {

// alpha, beta, gamma, delta, u(0), v(0)
using Parameters = Eigen::Matrix<double, 6, 1>;

constexpr int kNumCounts = 25;
constexpr int kStepsACount = 10;
constexpr double kTimeStep = 0.05;    // [years]
constexpr double kNoise = 0.1;        // of the logarithms
constexpr double kCeresRadius = 1e4;  // Ceres' default
constexpr int kNumStarts = 100;
// The largest standard deviation is that of log beta: 0.06, by (J^T J)^-1.
constexpr double kTolerance = 0.2;

Parameters Truth() {
  Parameters truth;
  truth << 1.0, 0.1, 1.5, 0.075, 10.0, 5.0;
  return truth;
}

template <typename T>
void Derivative(const T* rates, const T* uv, T* derivative) {
  const T meetings = uv[0] * uv[1];
  derivative[0] = rates[0] * uv[0] - rates[1] * meetings;
  derivative[1] = rates[3] * meetings - rates[2] * uv[1];
}

template <typename T>
void RungeKuttaStep(const T* rates, T* uv) {
  const double h = kTimeStep;
  T k1[2], k2[2], k3[2], k4[2], stage[2];
  Derivative(rates, uv, k1);
  for (int i = 0; i < 2; ++i) stage[i] = uv[i] + (0.5 * h) * k1[i];
  Derivative(rates, stage, k2);
  for (int i = 0; i < 2; ++i) stage[i] = uv[i] + (0.5 * h) * k2[i];
  Derivative(rates, stage, k3);
  for (int i = 0; i < 2; ++i) stage[i] = uv[i] + h * k3[i];
  Derivative(rates, stage, k4);
  for (int i = 0; i < 2; ++i) {
    uv[i] += (h / 6.0) * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
  }
}

struct CountError {
  Eigen::Matrix2Xd log_counts;  // 2 x kNumCounts

  template <typename T>
  bool operator()(const T* log_parameters, T* residuals) const {
    using std::exp;
    using std::log;
    T parameters[6];
    for (int i = 0; i < 6; ++i) parameters[i] = exp(log_parameters[i]);
    T uv[2] = {parameters[4], parameters[5]};
    for (int count = 0; count < kNumCounts; ++count) {
      for (int i = 0; i < 2; ++i) {
        if (!(uv[i] > 0.0)) return false;  // too fast for the time step
        residuals[2 * count + i] = (log(uv[i]) - log_counts(i, count)) / kNoise;
      }
      for (int k = 0; k < kStepsACount; ++k) RungeKuttaStep(parameters, uv);
    }
    return true;
  }
};

Eigen::Matrix2Xd Count() {
  // Without counts the error is what has been simulated.
  const Parameters log_truth = Truth().array().log();
  Eigen::Matrix2Xd simulated(2, kNumCounts);
  CHECK(CountError{Eigen::Matrix2Xd::Zero(2, kNumCounts)}(log_truth.data(),
                                                          simulated.data()));
  invgrad::NumpyGenerator random(4);
  return kNoise * (simulated + random.StandardNormal(2, kNumCounts));
}

// Guesses from which the simulation gets to the end.
std::vector<Parameters> Starts(const CountError& count_error) {
  invgrad::NumpyGenerator random(5);
  std::vector<Parameters> starts;
  while (starts.size() < kNumStarts) {
    Parameters start;
    start << Truth().head<4>().array().log(), count_error.log_counts.col(0);
    start.head<4>() += random.StandardNormal(4, 1);
    double residuals[2 * kNumCounts];
    if (count_error(start.data(), residuals)) starts.push_back(start);
  }
  return starts;
}

// Where a solve has ended.
struct Outcome {
  Parameters estimate;
  double cost;
  int num_iterations;
  invgrad::UpdateCallback::Summary proposals;

  // |log(estimate / truth)|
  double LargestError() const {
    return (estimate.array() / Truth().array()).log().abs().maxCoeff();
  }
  bool IsTruth() const { return LargestError() < std::log(1.0 + kTolerance); }
};

Outcome Identify(const CountError& count_error,
                 Parameters log_parameters,
                 double radius,
                 bool with_half_inverse) {
  // Build.
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<CountError, 2 * kNumCounts, 6>(
          new CountError(count_error)),
      nullptr,
      log_parameters.data());

  // Configure.
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 500;
  options.initial_trust_region_radius = radius;
  options.logging_type = ceres::SILENT;

  const auto rule = invgrad::MakeRule("half_inverse:step_size=auto:rho=1");
  std::optional<invgrad::UpdateCallback> callback;
  if (with_half_inverse) {
    callback.emplace(rule.get(), &problem);
    callback->AddTo(&options);
  }

  // Solve.
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return {log_parameters.array().exp(),
          summary.final_cost,
          static_cast<int>(summary.iterations.size()) - 1,
          callback ? callback->summary() : invgrad::UpdateCallback::Summary()};
}

// Prints a row about all outcomes of a solver; returns the one of least cost.
Outcome Report(const std::string& solver,
               const std::vector<Outcome>& outcomes) {
  Outcome best = *std::min_element(
      outcomes.begin(), outcomes.end(), [](const auto& a, const auto& b) {
        return a.cost < b.cost;
      });
  std::vector<int> num_iterations;
  for (const Outcome& outcome : outcomes) {
    if (outcome.IsTruth()) num_iterations.push_back(outcome.num_iterations);
  }
  CHECK(!num_iterations.empty()) << solver << " has never found the truth";
  std::sort(num_iterations.begin(), num_iterations.end());
  std::printf("%-20s  %4zu of %zu  %19d  %10.4g",
              solver.c_str(),
              num_iterations.size(),
              outcomes.size(),
              num_iterations[num_iterations.size() / 2],
              best.cost);
  for (const double parameter : best.estimate)
    std::printf("  %6.3g", parameter);
  std::printf("  %13.2g\n", best.LargestError());
  return best;
}

}  // namespace

int main(int /*argc*/, char** argv) {
  google::InitGoogleLogging(argv[0]);
  const CountError count_error{Count()};
  std::vector<Outcome> lm;
  std::vector<Outcome> short_lm;
  std::vector<Outcome> half_inverse;
  int num_only_lm = 0;
  int num_only_half_inverse = 0;
  invgrad::UpdateCallback::Summary proposals;  // of all solves
  for (const Parameters& start : Starts(count_error)) {
    lm.push_back(Identify(count_error, start, kCeresRadius, false));
    short_lm.push_back(Identify(count_error, start, 1.0, false));
    half_inverse.push_back(Identify(count_error, start, kCeresRadius, true));
    const bool by_lm = lm.back().IsTruth();
    const bool by_half_inverse = half_inverse.back().IsTruth();
    if (by_lm && !by_half_inverse) ++num_only_lm;
    if (by_half_inverse && !by_lm) ++num_only_half_inverse;
    const auto& counts = half_inverse.back().proposals;
    proposals.num_proposed += counts.num_proposed;
    proposals.num_accepted += counts.num_accepted;
    proposals.num_rejected += counts.num_rejected;
    proposals.num_ceres_steps += counts.num_ceres_steps;
  }
  std::printf(
      "%-20s  truth found  iterations (median)  least cost   alpha    beta   "
      "gamma   delta    u(0)    v(0)  largest error\n",
      "solver");
  const Outcome best_lm = Report("LM", lm);
  const Outcome best_short_lm = Report("LM, initial radius 1", short_lm);
  const Outcome best_half_inverse = Report("LM + half-inverse", half_inverse);
  std::printf("found only by LM: %d, only by LM + half-inverse: %d\n",
              num_only_lm,
              num_only_half_inverse);
  std::printf("proposals: %s\n", proposals.BriefReport().c_str());
  const bool is_found = best_lm.IsTruth() && best_short_lm.IsTruth() &&
                        best_half_inverse.IsTruth();
  std::printf(
      "truth %s (tolerance %g)\n", is_found ? "found" : "missed", kTolerance);
  return is_found ? 0 : 1;
}
