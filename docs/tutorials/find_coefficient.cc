// Finds a coefficient of a differential equation from noisy measurements of its
// solution, in a ceres::Problem: no tables, only the library.
//
// Sample runs:
//
//   build/release/bin/find_coefficient
//   build/release/bin/find_coefficient --deviation=0.02 --seed=3
//
// docs/tutorials/find_coefficient.md explains each part.

#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/numeric_diff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gflags/gflags.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/blas_threads.h"
#include "invgrad/equation.h"
#include "invgrad/minimize.h"
#include "invgrad/random.h"
#include "invgrad/rules.h"

DEFINE_double(deviation, 0.01, "of the measurements' errors");
DEFINE_int32(seed, 1, "of the measurements and of the initial weights");
DEFINE_int32(steps, 300, "iterations");

namespace {

// [equation]
// Burgers' equation, u_t + u u_x = nu u_xx. The inputs are u and the
// derivatives that are stated below, then the coefficients.
struct Burgers {
  template <typename T>
  bool operator()(const T* u, T* y) const {
    const T& nu = u[4];
    y[0] = u[1] + u[0] * u[2] - nu * u[3];
    return true;
  }
};
// [/equation]

// The solution for u(0, x) = -sin(pi x) by the formula of Cole and Hopf.
double Truth(double nu, double t, double x) {
  constexpr int kNumIntervals = 600;
  const double limit = std::sqrt(45.0 + 1.0 / (M_PI * nu));
  double numerator = 0.0, denominator = 0.0;
  for (int k = 0; k <= kNumIntervals; ++k) {
    const double q = limit * (2.0 * k / kNumIntervals - 1.0);
    const double z = x - 2.0 * std::sqrt(nu * t) * q;
    const double f =
        std::exp(-(1.0 + std::cos(M_PI * z)) / (2.0 * M_PI * nu) - q * q);
    numerator += std::sin(M_PI * z) * f;
    denominator += f;
  }
  return -numerator / denominator;
}

constexpr double kTrueNu = 0.02;
constexpr int kNumMeasurements = 200;

// All that the measurements tell if the solution is known for each nu: one
// parameter, as a yardstick.
struct DistanceToTruth {
  const Eigen::MatrixXd& points;
  const Eigen::VectorXd& measured;
  bool operator()(const double* nu, double* residuals) const {
    for (int s = 0; s < kNumMeasurements; ++s) {
      residuals[s] = Truth(*nu, points(0, s), points(1, s)) - measured[s];
    }
    return true;
  }
};

}  // namespace

int main(int argc, char** argv) {
  invgrad::SetBlasThreads(1);
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  using namespace invgrad;  // NOLINT

  const Box box = {Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(1.0, 1.0)};
  NumpyRandom random(FLAGS_seed);
  const Eigen::MatrixXd places = random.Rand(kNumMeasurements, 2).transpose();
  Eigen::VectorXd measured = FLAGS_deviation * random.Normal(kNumMeasurements);
  for (int s = 0; s < kNumMeasurements; ++s) {
    measured[s] += Truth(kTrueNu, places(0, s), places(1, s));
  }

  // [terms]
  Equation burgers;
  TrialFunction& trial = burgers.trial;
  trial.derivatives = std::make_shared<DerivativeSet>(
      "tx", std::vector<std::string>{"t", "x", "xx"});
  trial.boundary_values = [](const InputJet* a, InputJet* g) {
    g[0] = -sin(M_PI * a[1]);
  };
  trial.distance = [](const InputJet* a, InputJet* d) {
    d[0] = a[0] * a[1] * (1.0 - a[1]);
  };
  burgers.hidden = {16, 16, 16};
  burgers.coefficients = Eigen::VectorXd::Constant(1, 0.1);  // a first guess
  EquationTerm data = {
      "measurements",
      std::make_shared<ValueResidual>(trial, 1),
      {places,
       Eigen::VectorXd::Constant(kNumMeasurements, 1.0 / kNumMeasurements)}};
  data.weight = 1e-3;
  data.context = [&](const Eigen::VectorXd&, Eigen::Index s, auto c) {
    c[0] = measured[s];
  };
  burgers.terms = {{"equation",
                    std::make_shared<AutoDiffSimulator<Burgers, 5, 1>>(),
                    GaussPoints(box, {32, 40})},
                   data};
  // [/terms]

  // [solve]
  Eigen::VectorXd weights = EquationModel(burgers).network().InitialWeights(
      Initialization::kGlorotUniform, &random);
  ceres::Problem problem;
  std::string error;
  if (!AddEquationToProblem(&burgers, &weights, &problem, &error)) {
    std::fprintf(stderr, "%s\n", error.c_str());
    return 1;
  }
  const std::unique_ptr<UpdateRule> rule = MakeRule("geodesic");
  MinimizerOptions options;
  options.max_num_iterations = FLAGS_steps;
  MinimizerSummary summary;
  Minimize(options, rule.get(), &problem, &summary);
  // [/solve]

  double best = kTrueNu;
  ceres::Problem of_one;
  of_one.AddResidualBlock(new ceres::NumericDiffCostFunction<DistanceToTruth,
                                                             ceres::CENTRAL,
                                                             kNumMeasurements,
                                                             1>(
                              new DistanceToTruth{places, measured}),
                          nullptr,
                          &best);
  ceres::Solver::Summary ignored;
  ceres::Solve({}, &of_one, &ignored);
  std::printf(
      "measurements with deviation %g, seed %d: nu = %.5f, from the "
      "closed form %.5f, true %.5f\n%s\n",
      FLAGS_deviation,
      FLAGS_seed,
      burgers.coefficients[0],
      best,
      kTrueNu,
      summary.message.c_str());
  return 0;
}
