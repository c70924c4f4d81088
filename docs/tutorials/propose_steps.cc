// Geodesic and other steps in code that calls ceres::Solve: the length and the
// damping of a pendulum, from noisy angles.
//
//   q'' = -(g / l) sin q - c q',   angle_i = q(t_i) + noise
//   L = 1/2 sum_i (q(t_i) - angle_i)^2 / noise^2
//
// Estimated:  log l, log c, q(0), q'(0).
// Truth:      l = 1.5 m, c = 0.2 / s, q(0) = 1, released from rest.
// Data:       30 angles in 6 s, with normal noise of 0.05.
// Starts:     the first angle, at rest; l and c off by random factors,
//             lognormal with a standard deviation of e.
//
// propose_steps.md explains this program piece by piece.
//
// Sample runs:
//
//   propose_steps
//   propose_steps --rules=half_inverse:step_size=auto:rho=0.5 --starts=2000

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gflags/gflags.h"
#include "glog/logging.h"
#include "invgrad/random.h"
// [includes]
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"
// [/includes]

DEFINE_string(rules,
              "geodesic,"
              "half_inverse:step_size=auto:rho=1,"
              "half_inverse:step_size=auto:rho=1:truncation=1e-2,"
              "half_inverse:step_size=auto:rho=1:relative_damping=1e-2,"
              "half_inverse:step_size=auto:rho=1:control=gain,"
              "half_inverse,"
              "power:kappa=0.75:step_size=auto:rho=1,"
              "gauss_newton:step_size=auto:rho=1",
              "the rules that propose, see docs/rules.md");
DEFINE_int32(starts, 500, "starts of each solver");

namespace {

using Eigen::Vector4d;
using invgrad::Specification;

constexpr int kNumAngles = 30;
constexpr double kNoise = 0.05;       // [rad]
constexpr double kCeresRadius = 1e4;  // Ceres' default

// [functor]
// The angles of a pendulum every 0.2 s, against measured ones; parameters are
// log l, log c, q(0) and q'(0).
struct Swing {
  std::vector<double> angles;

  template <typename T>
  bool operator()(const T* parameters, T* residuals) const {
    using std::exp;
    const T stiffness = 9.81 / exp(parameters[0]);
    const T damping = exp(parameters[1]);
    State<T> s(parameters[2], parameters[3]);
    for (int i = 0; i < kNumAngles; ++i) {
      residuals[i] = (s[0] - angles[i]) / kNoise;
      for (int k = 0; k < 10; ++k) RungeKuttaStep(stiffness, damping, 0.02, &s);
    }
    return true;
  }

  template <typename T>
  using State = Eigen::Matrix<T, 2, 1>;  // angle and angular velocity

  template <typename T>
  static void RungeKuttaStep(const T& stiffness,
                             const T& damping,
                             double h,
                             State<T>* s) {
    const auto derivative = [&](const State<T>& at) -> State<T> {
      using std::sin;
      return {at[1], -stiffness * sin(at[0]) - damping * at[1]};
    };
    const State<T> k1 = derivative(*s);
    const State<T> k2 = derivative(*s + (0.5 * h) * k1);
    const State<T> k3 = derivative(*s + (0.5 * h) * k2);
    const State<T> k4 = derivative(*s + h * k3);
    *s += (h / 6.0) * (k1 + 2.0 * (k2 + k3) + k4);
  }
};
// [/functor]

Vector4d Truth() { return Vector4d(std::log(1.5), std::log(0.2), 1.0, 0.0); }

Swing Measure() {
  invgrad::NumpyGenerator random(7);
  // Without angles the residuals are what has been simulated.
  Swing swing{std::vector<double>(kNumAngles, 0.0)};
  std::vector<double> simulated(kNumAngles);
  CHECK(swing(Truth().data(), simulated.data()));
  for (int i = 0; i < kNumAngles; ++i) {
    swing.angles[i] = kNoise * (simulated[i] + random.StandardNormal());
  }
  return swing;
}

struct Outcome {
  Vector4d parameters;
  ceres::Solver::Summary solver;
  invgrad::UpdateCallback::Summary proposals;

  // Three standard deviations of log l and log c, by (J^T J)^-1 at the truth.
  bool IsTruth() const {
    return std::abs(parameters[0] - Truth()[0]) < 3 * 0.009 &&
           std::abs(parameters[1] - Truth()[1]) < 3 * 0.1;
  }
};

// By Ceres alone if `rule_text` is null.
Outcome Solve(const Swing& swing,
              const Vector4d& start,
              double radius,
              const char* rule_text) {
  // [solve]
  Vector4d parameters = start;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Swing, kNumAngles, 4>(new Swing(swing)),
      nullptr,
      parameters.data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 500;
  options.initial_trust_region_radius = radius;
  options.logging_type = ceres::SILENT;
  // [/solve]

  // [added]
  std::unique_ptr<invgrad::UpdateRule> rule;
  std::optional<invgrad::UpdateCallback> callback;
  if (rule_text != nullptr) {
    rule = invgrad::MakeRule(rule_text);
    callback.emplace(rule.get(), &problem);
    callback->AddTo(&options);
  }
  // [/added]

  // [report]
  Outcome outcome;
  ceres::Solve(options, &problem, &outcome.solver);
  outcome.parameters = parameters;
  if (callback) outcome.proposals = callback->summary();
  // [/report]
  return outcome;
}

// One solve, as it would be reported.
void ReportOne(const Swing& swing, const char* rule_text) {
  const Vector4d start(std::log(0.5), std::log(0.5), swing.angles.front(), 0.0);
  const Outcome outcome = Solve(swing, start, kCeresRadius, rule_text);
  std::printf("%s\n  length %.4g m, damping %.4g / s\n",
              outcome.solver.BriefReport().c_str(),
              std::exp(outcome.parameters[0]),
              std::exp(outcome.parameters[1]));
  if (rule_text != nullptr) {
    std::printf("  %s\n  comparison: %d iterations\n",
                outcome.proposals.BriefReport().c_str(),
                outcome.proposals.num_plain_iterations);
  }
}

// Prints a row about the solves from all starts.
void PrintRow(const char* label,
              const Swing& swing,
              double radius,
              const char* rule_text) {
  invgrad::NumpyGenerator random(1);
  // Of the solves that have found the truth, with those of the comparison.
  std::vector<int> num_iterations;
  double seconds = 0.0;
  for (int i = 0; i < FLAGS_starts; ++i) {
    Vector4d start(Truth()[0], Truth()[1], swing.angles.front(), 0.0);
    start.head<2>() += random.StandardNormal(2, 1);
    const Outcome outcome = Solve(swing, start, radius, rule_text);
    seconds += outcome.solver.total_time_in_seconds;
    if (outcome.IsTruth()) {
      num_iterations.push_back(
          static_cast<int>(outcome.solver.iterations.size()) - 1 +
          outcome.proposals.num_plain_iterations);
    }
  }
  std::sort(num_iterations.begin(), num_iterations.end());
  const std::string median =
      num_iterations.empty()
          ? "-"
          : std::to_string(num_iterations[num_iterations.size() / 2]);
  std::printf("%-55s  %4zu of %d  %19s  %10.2g\n",
              label,
              num_iterations.size(),
              FLAGS_starts,
              median.c_str(),
              1e3 * seconds / FLAGS_starts);
}

}  // namespace

int main(int argc, char** argv) {
  gflags::SetUsageMessage("proposes steps of update rules to ceres::Solve");
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  google::InitGoogleLogging(argv[0]);
  // Ceres logs an error for each start that cannot be simulated; the table
  // counts it as not found.
  FLAGS_minloglevel = google::GLOG_FATAL;
  std::string error;
  std::vector<Specification> rules;
  if (!invgrad::ParseSpecifications(FLAGS_rules, &rules, &error)) {
    std::fprintf(stderr, "--rules: %s\n", error.c_str());
    return 1;
  }
  for (const Specification& rule : rules) {
    if (invgrad::MakeRule(rule, &error) == nullptr) {
      std::fprintf(stderr, "--rules: %s\n", error.c_str());
      return 1;
    }
  }
  if (FLAGS_starts < 1) {
    std::fprintf(stderr, "--starts: must be at least 1\n");
    return 1;
  }
  const Swing swing = Measure();
  ReportOne(swing, nullptr);
  ReportOne(swing, "geodesic");

  std::printf("\n%-55s  truth found  iterations (median)  ms a solve\n",
              "proposed by");
  PrintRow("nobody", swing, kCeresRadius, nullptr);
  PrintRow("nobody; initial_trust_region_radius = 1", swing, 1.0, nullptr);
  for (const Specification& rule : rules) {
    PrintRow(rule.text.c_str(), swing, kCeresRadius, rule.text.c_str());
  }
  return 0;
}
