// Curve fitting with outliers: an exponential decay, a fifth of whose samples
// are wrong.
//
//   y_i = a exp(-b t_i) + c + noise,   L = 1/2 sum_i rho((y(t_i) - y_i)^2)
//
// Estimated:  a, b, c.
// Truth:      a = 2.5, b = 1.3 / s, c = 0.5.
// Data:       120 samples in [0, 4] s with normal noise of 0.05; each with a
//             probability of 1/5 replaced by a uniform number in [0, 5].
// Start:      a = 1, b = 0.1 / s, c = 0: the decay seems 13 times too slow.
// Loss:       Cauchy, of scale 0.1, twice the noise: a residual of 2 counts as
//             one of 0.2.
// Expect:     the squared loss misses the truth by tenths, since the outliers
//             pull the curve up; Cauchy's finds it within a few hundredths.
//
// Solved by Ceres' Levenberg-Marquardt, and by the same with geodesic steps
// proposed. Exits with 0 if both robust fits are within kTolerance of the
// truth.

#include <cmath>
#include <cstdio>
#include <optional>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "glog/logging.h"
#include "invgrad/random.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"

namespace {

const Eigen::Vector3d kTruth(2.5, 1.3, 0.5);  // a, b, c
const Eigen::Vector3d kStart(1.0, 0.1, 0.0);
constexpr double kNoise = 0.05;
// The largest standard deviation is that of b: 0.025, by (J^T J)^-1.
constexpr double kTolerance = 0.1;

struct Sample {
  double t;  // [s]
  double y;
};

template <typename T>
T Decay(const T* abc, double t) {
  using std::exp;
  return abc[0] * exp(-abc[1] * t) + abc[2];
}

struct DecayResidual {
  Sample sample;

  template <typename T>
  bool operator()(const T* abc, T* residual) const {
    residual[0] = Decay(abc, sample.t) - sample.y;
    return true;
  }
};

std::vector<Sample> Measure() {
  invgrad::NumpyGenerator random(1);
  std::vector<Sample> samples(120);
  for (Sample& sample : samples) {
    sample.t = 4.0 * random.Random();
    sample.y =
        Decay(kTruth.data(), sample.t) + kNoise * random.StandardNormal();
    if (random.Random() < 0.2) sample.y = 5.0 * random.Random();
  }
  return samples;
}

// Fits and prints the result; returns the largest error of a, b and c.
double Fit(const std::vector<Sample>& samples,
           bool is_robust,
           bool with_geodesic) {
  // Build.
  Eigen::Vector3d abc = kStart;
  ceres::Problem problem;
  for (const Sample& sample : samples) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<DecayResidual, 1, 3>(
            new DecayResidual{sample}),
        is_robust ? new ceres::CauchyLoss(2.0 * kNoise) : nullptr,
        abc.data());
  }

  // Configure.
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 200;
  options.logging_type = ceres::SILENT;

  const auto rule = invgrad::MakeRule("geodesic");
  std::optional<invgrad::UpdateCallback> callback;
  if (with_geodesic) {
    callback.emplace(rule.get(), &problem);
    callback->AddTo(&options);
  }

  // Solve.
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);

  // Report.
  const double largest_error = (abc - kTruth).cwiseAbs().maxCoeff();
  std::printf("%s loss, %s: %zu iterations, cost %.4g -> %.4g\n",
              is_robust ? "Cauchy" : "squared",
              with_geodesic ? "LM + geodesic" : "LM",
              summary.iterations.size() - 1,
              summary.initial_cost,
              summary.final_cost);
  std::printf("  a %.3f, b %.3f, c %.3f, largest error %.2g\n",
              abc[0],
              abc[1],
              abc[2],
              largest_error);
  if (callback)
    std::printf("  %s\n", callback->summary().BriefReport().c_str());
  return largest_error;
}

}  // namespace

int main(int /*argc*/, char** argv) {
  google::InitGoogleLogging(argv[0]);
  const std::vector<Sample> samples = Measure();
  Fit(samples, false, false);
  Fit(samples, false, true);
  const double lm = Fit(samples, true, false);
  const double geodesic = Fit(samples, true, true);
  const bool is_found = lm < kTolerance && geodesic < kTolerance;
  std::printf(
      "truth %s (tolerance %g)\n", is_found ? "found" : "missed", kTolerance);
  return is_found ? 0 : 1;
}
