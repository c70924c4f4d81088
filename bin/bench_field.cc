// Compares the time of a field simulator's derivatives with that of its value.
//
// Sample runs:
//
//   bench_field
//   bench_field --benchmark_filter=navier_stokes_64 --benchmark_repetitions=5
//
// Uses one thread. After the usual lines it prints ratios within this run, for
// Navier-Stokes on 32 x 32 and 64 x 64 cells and for the plume:
//
//   NAME/value            y
//   NAME/linearize        y, and what the products need
//   NAME/times            J v
//   NAME/transpose_times  J^T w
//   NAME/adjoint          y and J^T w

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "benchmark/benchmark.h"
#include "bin/support/benchmarks.h"
#include "glog/logging.h"
#include "problems/navier_stokes/navier_stokes.h"
#include "problems/plume_initial.h"

namespace invgrad {
namespace {

using Eigen::VectorXd;

struct Case {
  std::string name;
  std::shared_ptr<const Simulator> simulator;
  VectorXd x;
  VectorXd context;
};

std::vector<Case> Cases() {
  std::vector<Case> cases;
  for (const int cells : {32, 64}) {
    NavierStokesSettings settings;
    settings.cells = cells;
    NumpyRandom random(0);
    const DataSet batch = NavierStokesSamples(
        settings, RandomNavierStokesFields(settings, 1, &random));
    cases.push_back({fmt::format("navier_stokes_{}", cells),
                     std::make_shared<NavierStokesSimulator>(settings),
                     batch.solutions.col(0),
                     batch.contexts.col(0)});
  }
  PointProblem plume;
  std::string error;
  CHECK(PlumeInitial().Create(&plume, &error)) << error;
  cases.push_back({"plume", plume.simulator, plume.start, VectorXd()});
  return cases;
}

bool Run(RunCounts* counts, std::string* /*error*/) {
  const std::vector<Case> cases = Cases();
  for (const Case& each : cases) {
    const Simulator& simulator = *each.simulator;
    const double* x = each.x.data();
    const double* context = each.context.data();
    auto y = std::make_shared<VectorXd>(simulator.num_outputs());
    auto x_bar = std::make_shared<VectorXd>(simulator.num_inputs());
    RegisterBenchmark(each.name + "/value", [=, &simulator](auto& state) {
      for (auto _ : state) {
        CHECK(simulator.Evaluate(x, context, y->data(), nullptr));
      }
    });
    RegisterBenchmark(each.name + "/linearize", [=, &simulator](auto& state) {
      for (auto _ : state) {
        CHECK(simulator.Linearize(x, context, y->data()) != nullptr);
      }
    });
    RegisterBenchmark(each.name + "/times", [=, &simulator](auto& state) {
      const auto J = simulator.Linearize(x, context, y->data());
      const VectorXd v = VectorXd::Ones(J->cols());
      for (auto _ : state) J->Times(v, y.get());
    });
    RegisterBenchmark(
        each.name + "/transpose_times", [=, &simulator](auto& state) {
          const auto J = simulator.Linearize(x, context, y->data());
          const VectorXd w = VectorXd::Ones(J->rows());
          for (auto _ : state) J->TransposeTimes(w, x_bar.get());
        });
    RegisterBenchmark(each.name + "/adjoint", [=, &simulator](auto& state) {
      const auto covector = [&](const double* outputs, double* w) {
        std::copy_n(outputs, simulator.num_outputs(), w);
        return true;
      };
      for (auto _ : state) {
        CHECK(
            simulator.Adjoint(x, context, covector, y->data(), x_bar->data()));
      }
    });
  }
  RatioReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  *counts = reporter.counts();
  fmt::print("\nRatios of this run (medians of the repetitions)\n");
  for (const Case& each : cases) {
    for (const char* part :
         {"/linearize", "/times", "/transpose_times", "/adjoint"}) {
      reporter.PrintRatio(each.name + part, each.name + "/value");
    }
  }
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunBenchmarks(
      argc,
      argv,
      "times the derivatives of the simulators of fields",
      invgrad::Run);
}
