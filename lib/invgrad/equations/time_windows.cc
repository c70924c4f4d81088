#include "invgrad/time_windows.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <memory>
#include <utility>

#include "fmt/core.h"
#include "invgrad/dense_network.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// u of a trained window at its end, as the start of the next one. Its copies,
// of which an equation may keep several, share all windows before it.
InputFunction EndOf(const Equation& equation,
                    const VectorXd& weights,
                    double end) {
  struct Window {
    TrialFunction trial;
    Model model;
    VectorXd weights;
  };
  const auto window = std::make_shared<const Window>(
      Window{equation.trial, EquationModel(equation), weights});
  return [window, end](const InputJet* point, InputJet* u) {
    const TrialFunction& trial = window->trial;
    std::vector<InputJet> at_end(point,
                                 point + trial.derivatives->num_variables());
    at_end[0] = InputJet(end);
    EvaluateTrialFunction(trial,
                          *window->model.dense_network(),
                          window->weights,
                          at_end.data(),
                          u);
  };
}

// False, with *error, if the values at the end of a window do not start the
// next one.
bool CheckFirstOrderInTime(const DerivativeSet& derivatives,
                           std::string* error) {
  const char time = derivatives.variables()[0];
  for (int k = 1; k < derivatives.num_stated(); ++k) {
    const std::string& word = derivatives.word(k);
    if (std::count(word.begin(), word.end(), time) < 2) continue;
    *error = fmt::format(
        "the derivative {0}: windows hand over the values only; write u_{1}{1} "
        "as a system of first order in u and v = u_{1}",
        word,
        time);
    return false;
  }
  return true;
}

}  // namespace

bool WindowSolutions::At(const MatrixXd& points,
                         MatrixXd* u,
                         std::string* error) const {
  CHECK(!equations.empty());
  u->setConstant(equations[0].trial.num_functions,
                 points.cols(),
                 std::numeric_limits<double>::quiet_NaN());
  const std::size_t num_windows = equations.size();
  for (std::size_t k = 0; k < num_windows; ++k) {
    std::vector<Index> inside;
    for (Index s = 0; s < points.cols(); ++s) {
      const double t = points(0, s);
      if ((k == 0 || t > times[k]) &&
          (k + 1 == num_windows || t <= times[k + 1])) {
        inside.push_back(s);
      }
    }
    MatrixXd of_window;
    if (inside.empty()) continue;
    if (!Solution(equations[k],
                  weights[k],
                  points(Eigen::all, inside),
                  &of_window,
                  error)) {
      return false;
    }
    (*u)(Eigen::all, inside) = of_window;
  }
  return true;
}

bool SolveInWindows(const std::vector<double>& times,
                    const InputFunction& start,
                    const MakeWindowEquation& make_equation,
                    const std::string& method,
                    const TrainOptions& options,
                    WindowSolutions* solutions,
                    std::string* error) {
  CHECK_GE(times.size(), 2u);
  CHECK(std::adjacent_find(times.begin(),
                           times.end(),
                           std::not_fn(std::less<double>())) == times.end())
      << "The times must be ascending.";
  *solutions = WindowSolutions();
  if (times.size() > 2 && !options.checkpoint_path.empty()) {
    *error = fmt::format(
        "checkpoint_path: a checkpoint is of one window, and these are {}",
        times.size() - 1);
    return false;
  }
  solutions->times = {times[0]};
  TimeWindow window = {times[0], times[1], start};
  for (std::size_t k = 1; k < times.size(); ++k) {
    window.end = times[k];
    const Equation equation = make_equation(window);
    DataSet samples;
    if ((times.size() > 2 &&
         !CheckFirstOrderInTime(*equation.trial.derivatives, error)) ||
        !EquationSamples(equation, &samples, error)) {
      return false;
    }
    TrainOptions of_window = options;
    of_window.batch_size = 0;
    TrainResult run =
        Train(EquationModel(equation), samples, method, of_window);
    if (run.error.empty() &&
        (run.summary.termination_type == ceres::FAILURE ||
         run.summary.termination_type == ceres::USER_FAILURE)) {
      run.error = run.summary.message;
    }
    if (!run.error.empty()) {
      *error = fmt::format("window {}, t from {:g} to {:g}: {}",
                           k - 1,
                           window.begin,
                           window.end,
                           run.error);
      return false;
    }
    solutions->times.push_back(window.end);
    solutions->equations.push_back(equation);
    solutions->weights.push_back(run.weights);
    solutions->runs.push_back(std::move(run));
    if (solutions->runs.back().summary.termination_type ==
        ceres::USER_SUCCESS) {
      return true;
    }
    window = {times[k],
              times[k],
              EndOf(equation, solutions->weights.back(), window.end)};
  }
  return true;
}

}  // namespace invgrad
