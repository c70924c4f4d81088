// field/CASE/METHOD: derivatives of the simulators of fields, beside the value,
// for Navier-Stokes on 32 x 32 and 64 x 64 cells and for the plume:
//
//   value            y
//   linearize        y, and what the products need
//   times            J v
//   transpose_times  J^T w
//   adjoint          y and J^T w

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "benchmark/benchmark.h"
#include "bin/bench/bench.h"
#include "fmt/core.h"
#include "glog/logging.h"
#include "problems/navier_stokes/navier_stokes.h"
#include "problems/plume_initial.h"

namespace invgrad {
namespace {

using Eigen::VectorXd;

struct FieldCase {
  std::string name;
  std::shared_ptr<const Simulator> simulator;
  VectorXd x;
  VectorXd context;
};

std::vector<FieldCase> MakeFieldCases() {
  std::vector<FieldCase> cases;
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

const FieldCase& CaseOf(const std::string& name) {
  static const auto& cases = *new std::vector<FieldCase>(MakeFieldCases());
  return *std::find_if(cases.begin(), cases.end(), [&](const FieldCase& each) {
    return each.name == name;
  });
}

void Measure(const std::string& name,
             const std::string& method,
             benchmark::State* state) {
  const FieldCase& at = CaseOf(name);
  const Simulator& simulator = *at.simulator;
  const double* x = at.x.data();
  const double* context = at.context.data();
  VectorXd y(simulator.num_outputs());
  VectorXd x_bar(simulator.num_inputs());
  const auto covector = [&](const double* outputs, double* w) {
    std::copy_n(outputs, y.size(), w);
    return true;
  };
  const auto J = simulator.Linearize(x, context, y.data());
  const VectorXd v = VectorXd::Ones(J->cols());
  const VectorXd w = VectorXd::Ones(J->rows());
  for (auto _ : *state) {
    if (method == "value") {
      CHECK(simulator.Evaluate(x, context, y.data(), nullptr));
    } else if (method == "linearize") {
      CHECK(simulator.Linearize(x, context, y.data()) != nullptr);
    } else if (method == "times") {
      J->Times(v, &y);
    } else if (method == "transpose_times") {
      J->TransposeTimes(w, &x_bar);
    } else {
      CHECK(simulator.Adjoint(x, context, covector, y.data(), x_bar.data()));
    }
  }
}

}  // namespace

bool AddFieldBenchmarks(std::string* /*error*/) {
  for (const std::string name :
       {"navier_stokes_32", "navier_stokes_64", "plume"}) {
    const std::string prefix = "field/" + name + "/";
    for (const std::string method :
         {"value", "linearize", "times", "transpose_times", "adjoint"}) {
      AddBenchmark(prefix + method,
                   method == "value" ? "" : prefix + "value",
                   [=](auto& state) { Measure(name, method, &state); });
    }
  }
  return true;
}

}  // namespace invgrad
