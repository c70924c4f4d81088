/*
Solves an equation of evolution in windows of time, one network after another,
and compares with the known solution.

Sample runs:

  time_windows --problem=kdv_pinn --windows=4 --seconds=60
  time_windows --problem=allen_cahn_pinn:num_t=32 --windows=2 --steps=300 \
    --hidden=20-20-20 --seed=2 --output=runs/windows

--seconds and --steps are those of a window; --windows=1 is the training of a
single network for all times. Ctrl-C ends the current window, and skips the
others.

  DIR/table.txt, .md     the windows
  DIR/weights-K.npy      the weights of window K = 0, 1, ..
  DIR/solution.npy       rows (t, x, u, u*) at the points for testing
  DIR/solution.png       u*, u and the error
*/

#include "invgrad/time_windows.h"

#include <cmath>
#include <string>
#include <vector>

#include "bin/support/field_plots.h"
#include "bin/support/live_run.h"
#include "bin/support/program.h"
#include "bin/support/run_output.h"
#include "bin/support/training_flags.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/io/format.h"
#include "invgrad/method.h"
#include "invgrad/npy.h"
#include "problems/equations/evolutions.h"
#include "report/interrupt.h"

DEFINE_string(problem,
              "kdv_pinn",
              "burgers_pinn, kdv_pinn or allen_cahn_pinn, name[:key=value...]");
DEFINE_string(method, "geodesic", "a rule, as in compare");
DEFINE_int32(windows, 4, "equal windows of 0 <= t <= 1");
DEFINE_int32(seed, 1, "of the initial weights");

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double RelativeError(const VectorXd& u, const VectorXd& truth) {
  return (u - truth).norm() / truth.norm();
}

// u* of a problem at points.
VectorXd Truth(const EquationProblem& problem, const MatrixXd& points) {
  if (problem.solution_at != nullptr) return problem.solution_at(points);
  VectorXd truth(points.cols());
  for (Index s = 0; s < truth.size(); ++s) {
    truth[s] = problem.solution(points.col(s));
  }
  return truth;
}

bool Run(RunCounts* counts, std::string* error) {
  EvolutionProblem evolution;
  Method method;
  std::vector<int> widths = {1, 1};
  if (!CheckFlags({{"windows", {1.0, 1000.0}}, {"seed", {0.0}}}, error) ||
      !CheckTrainingFlags(error) ||
      !NameFlag("problem",
                CreateEvolution(FLAGS_problem, &evolution, error),
                error) ||
      !ParseFlag("method", ParseMethod, &method, error)) {
    return false;
  }
  if (!ParseWidths(NetworkOfFlags().hidden, &widths, error)) {
    *error = "--" + *error;
    return false;
  }
  if (FLAGS_seconds == 0.0 && FLAGS_steps == 0 && FLAGS_epochs == 0) {
    FLAGS_steps = 300;
  }
  std::vector<double> times;
  for (int k = 0; k <= FLAGS_windows; ++k) {
    times.push_back(static_cast<double>(k) / FLAGS_windows);
  }
  const EquationProblem whole =
      evolution.in_window({0.0, 1.0, evolution.start});
  const MatrixXd points =
      GridPoints(whole.test_box.value_or(whole.box), whole.test_counts);
  const VectorXd truth = Truth(whole, points);
  if (!PrepareRunDirectory(ExistingDirectory::kRefuse, error)) return false;
  const Interrupt interrupt;
  LiveCallback live(FLAGS_method);
  TrainOptions options = TrainOptionsOfFlags(0, FLAGS_seed);
  options.callbacks = {&live};
  const auto make_equation = [&](const TimeWindow& window) {
    Equation equation = evolution.in_window(window).equation;
    if (widths.size() > 2) {
      equation.hidden.assign(widths.begin() + 1, widths.end() - 1);
    }
    return equation;
  };
  WindowSolutions solutions;
  MatrixXd u;
  if (!SolveInWindows(times,
                      evolution.start,
                      make_equation,
                      FLAGS_method,
                      options,
                      &solutions,
                      error) ||
      !solutions.At(points, &u, error)) {
    return false;
  }
  Table table;
  for (std::size_t k = 0; k < solutions.runs.size(); ++k) {
    std::vector<Index> inside;
    for (Index s = 0; s < points.cols(); ++s) {
      if (points(0, s) > times[k] && points(0, s) <= times[k + 1]) {
        inside.push_back(s);
      }
    }
    const TrainResult& run = solutions.runs[k];
    counts->Add(true);
    table.BeginRow();
    table.Add("window", std::to_string(k));
    table.Add("t", fmt::format("{:g} - {:g}", times[k], times[k + 1]));
    table.Add("loss", FormatNumber(run.history.back().train_loss));
    table.Add("L2_error",
              FormatNumber(
                  RelativeError(u.row(0)(inside).transpose(), truth(inside))));
    table.Add("steps", std::to_string(run.summary.num_steps));
    table.Add("s", FormatNumber(run.summary.train_time_in_seconds));
    table.Add("status", run.summary.message, Table::Align::kLeft);
    if (!WriteNpy(fmt::format("{}/weights-{}.npy", FLAGS_output, k),
                  run.weights,
                  error)) {
      return false;
    }
  }
  MatrixXd rows(points.cols(), 4);
  rows << points.transpose(), u.row(0).transpose(), truth;
  if (!WriteTable(FLAGS_output + "/table", table, error) ||
      !WriteNpy(FLAGS_output + "/solution.npy", rows, error)) {
    return false;
  }
  fmt::print("{}L2_error of all times: {}\nresults in {}\n",
             table.ToText(),
             FormatNumber(RelativeError(u.row(0).transpose(), truth)),
             FLAGS_output);
  Picture picture = {FLAGS_output + "/solution.png", {}, 3};
  AddFunctionPanels("u*", whole.test_counts[0], truth, nullptr, &picture);
  AddFunctionPanels(
      "u", whole.test_counts[0], u.row(0).transpose(), &truth, &picture);
  DrawPictures({picture});
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(argc,
                             argv,
                             "solves an equation of evolution in windows of "
                             "time, one network after another",
                             invgrad::Run);
}
