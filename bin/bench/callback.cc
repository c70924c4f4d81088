// callback/PROBLEM/METHOD: ceres::Solve with an UpdateCallback whose rule always
// declines: what proposals cost by themselves. One thread.
//
//   plain       ceres::Solve alone
//   declining   the rule needs nothing
//   asking      the rule needs the Jacobian
//
// PROBLEM: the identification of a pendulum from 1,000 samples, each a roll-out
// of up to 300 time steps; with --input also a bundle adjustment.

#include <cmath>
#include <filesystem>
#include <memory>
#include <string>

#include "benchmark/benchmark.h"
#include "bin/bench/bench.h"
#include "bin/support/program.h"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/update_callback.h"
#include "problems/estimation/bal_file.h"
#include "problems/estimation/bundle_adjustment.h"

namespace invgrad {
namespace {

class DecliningRule final : public UpdateRule {
 public:
  explicit DecliningRule(bool needs_jacobian)
      : needs_jacobian_(needs_jacobian) {}

  LinearizationParts Needs() const override {
    LinearizationParts parts;
    parts.jacobian = needs_jacobian_;
    return parts;
  }
  bool ComputeStep(const Linearization& /*at_x*/,
                   Eigen::VectorXd* /*step*/,
                   std::string* error) override {
    *error = "declined";
    return false;
  }

 private:
  const bool needs_jacobian_;
};

// The angle of a damped pendulum after `num_steps` steps of the symplectic
// Euler method; x holds damping, stiffness and the angle at the start.
struct PendulumSample {
  int num_steps;
  double measured;

  template <typename T>
  bool operator()(const T* x, T* r) const {
    constexpr double kTimeStep = 0.01;
    T angle = x[2];
    T velocity(0.0);
    for (int i = 0; i < num_steps; ++i) {
      velocity -= kTimeStep * (x[0] * velocity + x[1] * sin(angle));
      angle += kTimeStep * velocity;
    }
    r[0] = angle - measured;
    return true;
  }
};

// A problem with the same initial values for every instance: of the file; the
// pendulum if it has no observations.
struct Instance {
  explicit Instance(const BalData& data) : bal(data) {
    options.logging_type = ceres::SILENT;
    options.num_threads = 1;
    options.max_num_iterations = 20;
    if (!bal.observations.empty()) {
      AddBundleAdjustment([] { return nullptr; }, &bal, &problem);
      options.linear_solver_type = ceres::DENSE_SCHUR;
      options.linear_solver_ordering = PointsFirst(&bal);
      return;
    }
    const double truth[] = {0.2, 4.0, 1.0};
    constexpr int kNumSamples = 1000;
    for (int i = 0; i < kNumSamples; ++i) {
      auto* sample = new PendulumSample{300 * (i + 1) / kNumSamples, 0};
      (*sample)(truth, &sample->measured);
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<PendulumSample, 1, 3>(sample),
          nullptr,
          pendulum);
    }
    options.linear_solver_type = ceres::DENSE_QR;
  }

  BalData bal;
  double pendulum[3] = {0.05, 3.0, 0.5};
  ceres::Problem problem;
  ceres::Solver::Options options;
};

enum class Rule { kNone, kDeclines, kAsks };

// input: of a bundle adjustment; empty: the pendulum.
void Solve(const std::string& input, Rule kind, benchmark::State* state) {
  BalData data;
  std::string error;
  if (!input.empty() && !ReadBalFile(input, &data, &error)) {
    state->SkipWithError(error.c_str());
    return;
  }
  for (auto _ : *state) {
    state->PauseTiming();
    auto instance = std::make_unique<Instance>(data);
    ceres::Solver::Summary summary;
    state->ResumeTiming();
    if (kind == Rule::kNone) {
      ceres::Solve(instance->options, &instance->problem, &summary);
    } else {
      DecliningRule rule(kind == Rule::kAsks);
      UpdateCallback callback(&rule, &instance->problem);
      callback.AddTo(&instance->options);
      ceres::Solve(instance->options, &instance->problem, &summary);
    }
    state->PauseTiming();
    if (!summary.IsSolutionUsable()) {
      state->SkipWithError(summary.BriefReport().c_str());
    }
    state->counters["iterations"] =
        static_cast<double>(summary.iterations.size() - 1);
    instance.reset();
    state->ResumeTiming();
  }
}

void Add(const std::string& name, const std::string& input) {
  const std::string prefix = "callback/" + name + "/";
  const auto add = [&](const std::string& method, Rule kind) {
    AddBenchmark(prefix + method,
                 kind == Rule::kNone ? "" : prefix + "plain",
                 [=](auto& state) { Solve(input, kind, &state); });
  };
  add("plain", Rule::kNone);
  add("declining", Rule::kDeclines);
  add("asking", Rule::kAsks);
}

}  // namespace

bool AddCallbackBenchmarks(std::string* /*error*/) {
  Add("pendulum", "");
  for (const std::string& file : SplitList(FLAGS_input)) {
    Add(std::filesystem::path(file).stem(), file);
  }
  return true;
}

}  // namespace invgrad
