/*
Compares the time of ceres::Solve with and without an UpdateCallback, as ratios
within one run.

Sample runs:

  bench_callback --input=problem-16-22106-pre.txt.bz2 \
    --benchmark_repetitions=9 --benchmark_enable_random_interleaving=true
  bench_callback --steps=300     # without a file: an expensive functor

  plain       ceres::Solve
  declining   an UpdateCallback whose rule always declines
  asking      the same with a rule that needs the Jacobian: the overhead of
              proposals
  cached      the same with a new CachedProblem each time
  linearize   one linearization at the start, by evaluations
  remembered  the same from the stored values of a CachedProblem

Uses one thread. Without --input the problem is the identification of a pendulum
from samples, each a roll-out of up to --steps time steps.
*/

#include <cmath>
#include <functional>
#include <memory>
#include <string>

#include "benchmark/benchmark.h"
#include "bin/support/benchmarks.h"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gflags/gflags.h"
#include "glog/logging.h"
#include "invgrad/ceres/cached_problem.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/ceres/update_callback.h"
#include "problems/estimation/bal_file.h"
#include "problems/estimation/bundle_adjustment.h"

DEFINE_string(input, "", "a bundle adjustment file; empty: the pendulum");
DEFINE_int32(steps, 300, "time steps of the pendulum's longest roll-out");
DEFINE_int32(samples, 1000, "samples of the pendulum");

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

// A problem with the same initial values for every instance: of the file, or
// the pendulum.
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
    for (int i = 0; i < FLAGS_samples; ++i) {
      auto* sample =
          new PendulumSample{FLAGS_steps * (i + 1) / FLAGS_samples, 0};
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

void Run(benchmark::State& state,
         const BalData& data,
         const std::function<void(Instance*, ceres::Solver::Summary*)>& solve) {
  for (auto _ : state) {
    state.PauseTiming();
    auto instance = std::make_unique<Instance>(data);
    ceres::Solver::Summary summary;
    state.ResumeTiming();
    solve(instance.get(), &summary);
    state.PauseTiming();
    if (!summary.IsSolutionUsable()) {
      state.SkipWithError(summary.BriefReport().c_str());
    }
    state.counters["iterations"] =
        static_cast<double>(summary.iterations.size() - 1);
    instance.reset();
    state.ResumeTiming();
  }
}

void Linearize(benchmark::State& state, ceres::Problem* problem) {
  const ProblemLinearizer linearizer(problem, {});
  LinearizationParts parts;
  parts.jacobian = true;
  std::string error;
  for (auto _ : state) {
    Linearization at_x;
    CHECK(linearizer.Linearize(parts, &at_x, &error)) << error;
    benchmark::DoNotOptimize(at_x.cost);
  }
}

bool RunAll(RunCounts* counts, std::string* error) {
  BalData data;
  if (!CheckFlags({{"steps", {1.0}}, {"samples", {3.0}}}, error) ||
      (!FLAGS_input.empty() && !ReadBalFile(FLAGS_input, &data, error))) {
    return false;
  }
  const auto add = [&data](const char* name, auto solve) {
    RegisterBenchmark(name, [&data, solve](benchmark::State& state) {
      Run(state, data, solve);
    });
  };
  const auto decline = [](bool needs_jacobian,
                          ceres::Problem* problem,
                          Instance* instance,
                          ceres::Solver::Summary* summary) {
    DecliningRule rule(needs_jacobian);
    UpdateCallback callback(&rule, problem);
    callback.AddTo(&instance->options);
    ceres::Solve(instance->options, problem, summary);
  };
  add("plain", [](Instance* instance, auto* summary) {
    ceres::Solve(instance->options, &instance->problem, summary);
  });
  add("declining", [decline](Instance* instance, auto* summary) {
    decline(false, &instance->problem, instance, summary);
  });
  add("asking", [decline](Instance* instance, auto* summary) {
    decline(true, &instance->problem, instance, summary);
  });
  add("cached", [decline](Instance* instance, auto* summary) {
    CachedProblem cached({}, &instance->problem);
    decline(true, cached.problem(), instance, summary);
  });
  RegisterBenchmark("linearize", [&data](benchmark::State& state) {
    Instance instance(data);
    Linearize(state, &instance.problem);
  });
  RegisterBenchmark("remembered", [&data](benchmark::State& state) {
    Instance instance(data);
    CachedProblem cached({}, &instance.problem);
    Linearize(state, cached.problem());
  });
  RatioReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  *counts = reporter.counts();
  for (const char* name : {"declining", "asking", "cached"}) {
    reporter.PrintRatio(name, "plain");
  }
  reporter.PrintRatio("remembered", "linearize");
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunBenchmarks(
      argc,
      argv,
      "times ceres::Solve with an UpdateCallback beside ceres::Solve alone",
      invgrad::RunAll);
}
