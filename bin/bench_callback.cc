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

Uses one thread. The problem is the bundle adjustment of --input or, without
--input, the identification of a pendulum from samples, each a roll-out of up to
--steps time steps.
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
#include "invgrad/core/blas.h"
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

// A problem with the same initial values for every instance.
struct Instance {
  BalData bal;
  double pendulum[3] = {0.05, 3.0, 0.5};
  ceres::Problem problem;
  ceres::Solver::Options options;
};

std::unique_ptr<Instance> MakePendulum() {
  auto instance = std::make_unique<Instance>();
  const double truth[] = {0.2, 4.0, 1.0};
  for (int i = 0; i < FLAGS_samples; ++i) {
    auto* sample = new PendulumSample{FLAGS_steps * (i + 1) / FLAGS_samples, 0};
    (*sample)(truth, &sample->measured);
    instance->problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<PendulumSample, 1, 3>(sample),
        nullptr,
        instance->pendulum);
  }
  instance->options.linear_solver_type = ceres::DENSE_QR;
  return instance;
}

std::unique_ptr<Instance> MakeBundle(const BalData& data) {
  auto instance = std::make_unique<Instance>();
  instance->bal = data;
  AddBundleAdjustment(
      [] { return nullptr; }, &instance->bal, &instance->problem);
  instance->options.linear_solver_type = ceres::DENSE_SCHUR;
  instance->options.linear_solver_ordering = PointsFirst(&instance->bal);
  return instance;
}

using MakeInstance = std::function<std::unique_ptr<Instance>()>;

void Run(benchmark::State& state,
         const MakeInstance& make,
         const std::function<void(Instance*, ceres::Solver::Summary*)>& solve) {
  for (auto _ : state) {
    state.PauseTiming();
    std::unique_ptr<Instance> instance = make();
    instance->options.logging_type = ceres::SILENT;
    instance->options.num_threads = 1;
    instance->options.max_num_iterations = 20;
    ceres::Solver::Summary summary;
    state.ResumeTiming();
    solve(instance.get(), &summary);
    state.PauseTiming();
    if (!summary.IsSolutionUsable()) {
      state.SkipWithError(summary.BriefReport().c_str());
    }
    state.counters["iterations"] =
        static_cast<double>(summary.iterations.size());
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

bool RunAll(std::string* error) {
  if (!CheckFlags({{"steps", {1.0}}, {"samples", {3.0}}}, error)) return false;
  BalData data;
  MakeInstance make = MakePendulum;
  if (!FLAGS_input.empty()) {
    if (!ReadBalFile(FLAGS_input, &data, error)) return false;
    make = [&data] { return MakeBundle(data); };
  }
  const SingleBlasThread single(true);
  const auto add = [&](const char* name, auto solve) {
    RegisterBenchmark(name, [&make, solve](benchmark::State& state) {
      Run(state, make, solve);
    });
  };
  const auto solve_declining = [](bool needs_jacobian) {
    return [=](Instance* instance, ceres::Solver::Summary* summary) {
      DecliningRule rule(needs_jacobian);
      UpdateCallback callback(&rule, &instance->problem);
      callback.AddTo(&instance->options);
      ceres::Solve(instance->options, &instance->problem, summary);
    };
  };
  add("plain", [](Instance* instance, ceres::Solver::Summary* summary) {
    ceres::Solve(instance->options, &instance->problem, summary);
  });
  add("declining", solve_declining(/*needs_jacobian=*/false));
  add("asking", solve_declining(/*needs_jacobian=*/true));
  add("cached", [](Instance* instance, ceres::Solver::Summary* summary) {
    DecliningRule rule(/*needs_jacobian=*/true);
    CachedProblem cached({}, &instance->problem);
    UpdateCallback callback(&rule, cached.problem());
    callback.AddTo(&instance->options);
    ceres::Solve(instance->options, cached.problem(), summary);
  });
  RegisterBenchmark("linearize", [&](benchmark::State& state) {
    Linearize(state, &make()->problem);
  });
  RegisterBenchmark("remembered", [&](benchmark::State& state) {
    const std::unique_ptr<Instance> instance = make();
    CachedProblem cached({}, &instance->problem);
    Linearize(state, cached.problem());
  });
  RatioReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
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
