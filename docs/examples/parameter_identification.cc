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
//             Ceres' defaults, and one start in ten more with half-inverse
//             steps proposed, in twice the iterations, because the solve without
//             proposals runs as well. What helps more, from three starts in
//             five, is a first step that is not too long:
//             initial_trust_region_radius = 1 in place of 1e4.
//
// Exits with 0 if each solver's estimate of least cost is within a factor of
// 1 + kTolerance of the truth in every parameter.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "glog/logging.h"
#include "invgrad/random.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"

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
using Counts = Eigen::Matrix<T, 2, 1>;  // u, v

template <typename T>
Counts<T> Derivative(const T* rates, const Counts<T>& uv) {
  const T meetings = uv[0] * uv[1];
  return {rates[0] * uv[0] - rates[1] * meetings,
          rates[3] * meetings - rates[2] * uv[1]};
}

template <typename T>
void RungeKuttaStep(const T* rates, Counts<T>* uv) {
  const double h = kTimeStep;
  const Counts<T> k1 = Derivative<T>(rates, *uv);
  const Counts<T> k2 = Derivative<T>(rates, *uv + (0.5 * h) * k1);
  const Counts<T> k3 = Derivative<T>(rates, *uv + (0.5 * h) * k2);
  const Counts<T> k4 = Derivative<T>(rates, *uv + h * k3);
  *uv += (h / 6.0) * (k1 + 2.0 * (k2 + k3) + k4);
}

struct CountError {
  Eigen::Matrix2Xd log_counts;  // 2 x kNumCounts

  template <typename T>
  bool operator()(const T* log_parameters, T* residuals) const {
    using std::exp;
    using std::log;
    T parameters[6];
    for (int i = 0; i < 6; ++i) parameters[i] = exp(log_parameters[i]);
    Counts<T> uv(parameters[4], parameters[5]);
    for (int count = 0; count < kNumCounts; ++count) {
      for (int i = 0; i < 2; ++i) {
        if (!(uv[i] > 0.0)) return false;  // too fast for the time step
        residuals[2 * count + i] = (log(uv[i]) - log_counts(i, count)) / kNoise;
      }
      for (int k = 0; k < kStepsACount; ++k) RungeKuttaStep(parameters, &uv);
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

// The solves of one solver from all starts.
struct Outcomes {
  std::vector<bool> found;  // whether a start led to the truth
  Parameters best;          // the estimate of least cost
};

bool IsTruth(const Parameters& estimate) {
  return (estimate.array() / Truth().array()).log().abs().maxCoeff() <
         std::log(1.0 + kTolerance);
}

// Solves from all starts and prints the result.
Outcomes Identify(const char* label,
                  const CountError& count_error,
                  const std::vector<Parameters>& starts,
                  double radius,
                  bool with_half_inverse) {
  Outcomes outcomes;
  double least_cost = std::numeric_limits<double>::infinity();
  // Of the solves that found the truth, with those of the comparison.
  std::vector<int> num_iterations;
  invgrad::UpdateCallback::Summary proposals;  // of all solves
  for (Parameters log_parameters : starts) {
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

    // Report.
    const Parameters estimate = log_parameters.array().exp();
    outcomes.found.push_back(IsTruth(estimate));
    if (outcomes.found.back()) {
      num_iterations.push_back(
          static_cast<int>(summary.iterations.size()) - 1 +
          (callback ? callback->summary().num_plain_iterations : 0));
    }
    if (summary.final_cost < least_cost) {
      least_cost = summary.final_cost;
      outcomes.best = estimate;
    }
    if (callback) {
      proposals.num_proposed += callback->summary().num_proposed;
      proposals.num_accepted += callback->summary().num_accepted;
      proposals.num_rejected += callback->summary().num_rejected;
      proposals.num_ceres_steps += callback->summary().num_ceres_steps;
    }
  }
  CHECK(!num_iterations.empty()) << label << " has never found the truth";
  std::sort(num_iterations.begin(), num_iterations.end());
  std::printf(
      "%s: truth found from %zu of %zu starts, in %d iterations "
      "(median)\n  least cost %.4g, with the parameters",
      label,
      num_iterations.size(),
      starts.size(),
      num_iterations[num_iterations.size() / 2],
      least_cost);
  for (const double parameter : outcomes.best) std::printf(" %.3g", parameter);
  std::printf("\n");
  if (with_half_inverse) {
    std::printf("  %s\n", proposals.BriefReport().c_str());
  }
  return outcomes;
}

}  // namespace

int main(int /*argc*/, char** argv) {
  google::InitGoogleLogging(argv[0]);
  const CountError count_error{Count()};
  const std::vector<Parameters> starts = Starts(count_error);
  const Outcomes lm = Identify("LM", count_error, starts, kCeresRadius, false);
  const Outcomes short_lm =
      Identify("LM, initial radius 1", count_error, starts, 1.0, false);
  const Outcomes half_inverse =
      Identify("LM + half-inverse", count_error, starts, kCeresRadius, true);
  int num_only_lm = 0;
  int num_only_half_inverse = 0;
  for (size_t i = 0; i < starts.size(); ++i) {
    if (lm.found[i] && !half_inverse.found[i]) ++num_only_lm;
    if (half_inverse.found[i] && !lm.found[i]) ++num_only_half_inverse;
  }
  std::printf("found only by LM: %d, only by LM + half-inverse: %d\n",
              num_only_lm,
              num_only_half_inverse);
  const bool is_found =
      IsTruth(lm.best) && IsTruth(short_lm.best) && IsTruth(half_inverse.best);
  std::printf(
      "truth %s (tolerance %g)\n", is_found ? "found" : "missed", kTolerance);
  return is_found ? 0 : 1;
}
