/*
Solves an equation of evolution in windows of time, one network after another,
and compares with the known solution.

Sample runs:

  time_windows --problem=kdv_pinn --windows=4 --seconds=60
  time_windows --problem=allen_cahn_pinn:num_t=32 --windows=2 --steps=300 \
    --hidden=20-20-20 --seed=2 --output=runs/windows

--seconds and --steps are those of a window; --windows=1 is the training of a
single network for all times. Ctrl-C ends the current window, and skips the
others; so does a window that fails. Errors and files are then of the windows
so far.

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
#include "bin/support/flags.h"
#include "bin/support/live_run.h"
#include "bin/support/output_options.h"
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
              "burgers_pinn, kdv_pinn, two_solitons_pinn or allen_cahn_pinn, "
              "name[:key=value...]");
DEFINE_string(method, "geodesic", "a rule, as in compare");
DEFINE_int32(windows, 4, "equal windows of the problem's time");
DEFINE_int32(seed, 1, "of the initial weights");

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Those that a window uses have flags.
TrainingFlags& Training() {
  static auto& flags = *new TrainingFlags;
  return flags;
}

void AddTrainingFlags() {
  TrainingFlags& training = Training();
  training.AddShared();
  AddFlag("steps",
          &training.steps,
          "budget of a window in steps; 0: none, or 300 if --seconds is 0");
  AddFlag("seconds",
          &training.seconds,
          "budget of a window in seconds of training; 0: none");
}

double RelativeError(const VectorXd& u, const VectorXd& truth) {
  return (u - truth).norm() / truth.norm();
}

struct Settings {
  EvolutionProblem evolution;
  EquationProblem whole;      // for all times
  std::vector<int> widths;    // of the network, if --hidden sets them
  std::vector<double> times;  // the ends of the windows
  MatrixXd points;            // for testing
  VectorXd truth;             // u* there
};

bool Check(Settings* settings, std::string* error) {
  Method method;
  settings->widths = {1, 1};
  if (!CheckFlags({{"windows", {1.0, 1000.0}},
                   {"seed", {0.0}},
                   {"steps", {0.0}},
                   {"seconds", {0.0}},
                   {"threads", {1.0, 1024.0}}},
                  error) ||
      !NameFlag("problem",
                CreateEvolution(FLAGS_problem, &settings->evolution, error),
                error) ||
      !ParseFlag("method", ParseMethod, &method, error)) {
    return false;
  }
  if (!ParseWidths(Training().network.hidden, &settings->widths, error)) {
    *error = "--" + *error;
    return false;
  }
  TrainingFlags& training = Training();
  if (training.seconds == 0.0 && training.steps == 0) training.steps = 300;
  const EvolutionProblem& evolution = settings->evolution;
  for (int k = 0; k <= FLAGS_windows; ++k) {
    settings->times.push_back(evolution.end * k / FLAGS_windows);
  }
  settings->whole = evolution.in_window({0.0, evolution.end, evolution.start});
  const EquationProblem& whole = settings->whole;
  settings->points =
      GridPoints(whole.test_box.value_or(whole.box), whole.test_counts);
  settings->truth = whole.SolutionAt(settings->points);
  return true;
}

// Those so far if a window fails.
WindowSolutions Solve(const Settings& settings, std::string* error) {
  LiveCallback live(FLAGS_method);
  TrainOptions options = Training().Options(0, FLAGS_seed);
  options.callbacks = {&live};
  const auto make_equation = [&settings](const TimeWindow& window) {
    Equation equation = settings.evolution.in_window(window).equation;
    const std::vector<int>& widths = settings.widths;
    if (widths.size() > 2) {
      equation.hidden.assign(widths.begin() + 1, widths.end() - 1);
    }
    return equation;
  };
  WindowSolutions solutions;
  SolveInWindows(settings.times,
                 settings.evolution.start,
                 make_equation,
                 FLAGS_method,
                 options,
                 &solutions,
                 error);
  return solutions;
}

// The row of window k.
void AddWindow(const Settings& settings,
               std::size_t k,
               const TrainResult& run,
               const MatrixXd& u,
               Table* table) {
  const MatrixXd& points = settings.points;
  const double begin = settings.times[k], end = settings.times[k + 1];
  std::vector<Index> inside;
  for (Index s = 0; s < points.cols(); ++s) {
    if (points(0, s) > begin && points(0, s) <= end) inside.push_back(s);
  }
  table->BeginRow();
  table->Add("window", std::to_string(k));
  table->Add("t", fmt::format("{:g} - {:g}", begin, end));
  table->Add("loss", FormatNumber(run.history.back().train_loss));
  table->Add("L2_error",  // none without points for testing
             NumberOrDash(RelativeError(u.row(0)(inside).transpose(),
                                        settings.truth(inside))));
  table->Add("steps", std::to_string(run.summary.num_steps));
  table->Add("s", FormatNumber(run.summary.train_time_in_seconds));
  table->Add("status", run.summary.message, Table::Align::kLeft);
}

template <typename Array>
bool WriteArray(const std::string& name,
                const Array& array,
                std::string* error) {
  return ListRunFile(InOutput(name), error) &&
         WriteNpy(InOutput(name), array, error);
}

// Of the windows that were solved, at least one.
bool Report(const Settings& settings,
            const WindowSolutions& solutions,
            const MatrixXd& u,
            std::string* error) {
  Table table;
  for (std::size_t k = 0; k < solutions.runs.size(); ++k) {
    AddWindow(settings, k, solutions.runs[k], u, &table);
    if (!WriteArray(
            fmt::format("weights-{}.npy", k), solutions.weights[k], error)) {
      return false;
    }
  }
  const VectorXd& truth = settings.truth;
  MatrixXd rows(settings.points.cols(), 4);
  rows << settings.points.transpose(), u.row(0).transpose(), truth;
  if (!WriteTable(InOutput("table"), table, error) ||
      !WriteArray("solution.npy", rows, error)) {
    return false;
  }
  const bool is_complete = solutions.times.size() == settings.times.size();
  fmt::print("{}L2_error of {}: {}\nresults in {}\n",
             table.ToText(),
             is_complete
                 ? "all times"
                 : fmt::format("0 <= t <= {:g}", solutions.times.back()),
             NumberOrDash(RelativeError(u.row(0).transpose(), truth)),
             Output().output);
  Picture picture = {InOutput("solution.png"), {}, 3};
  // x changes faster than t.
  const int num_times =
      static_cast<int>(truth.size()) / settings.whole.test_counts[1];
  if (num_times > 0) {
    AddFunctionPanels("u*", num_times, truth, nullptr, &picture);
    AddFunctionPanels("u", num_times, u.row(0).transpose(), &truth, &picture);
  }
  DrawPictures({picture});
  return true;
}

bool Run(RunCounts* counts, std::string* error) {
  Settings settings;
  if (!Check(&settings, error) ||
      !PrepareRunDirectory(ExistingDirectory::kRefuse, error)) {
    return false;
  }
  const Interrupt interrupt;
  std::string failure;
  const WindowSolutions solutions = Solve(settings, &failure);
  for (std::size_t k = 0; k < solutions.runs.size(); ++k) counts->Add(true);
  if (!failure.empty()) {
    counts->Add(false);
    Warn(failure);
  }
  if (solutions.runs.empty()) return true;
  const Index num_points =
      (settings.points.row(0).array() <= solutions.times.back()).count();
  settings.points.conservativeResize(Eigen::NoChange, num_points);
  settings.truth.conservativeResize(num_points);
  MatrixXd u;
  return solutions.At(settings.points, &u, error) &&
         Report(settings, solutions, u, error);
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  invgrad::AddOutputFlags();
  invgrad::AddTrainingFlags();
  return invgrad::RunProgram(argc,
                             argv,
                             "solves an equation of evolution in windows of "
                             "time, one network after another",
                             invgrad::Run);
}
