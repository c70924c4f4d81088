#include "bin/support/field_plots.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "fmt/core.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr size_t kMaxNumRuns = 6;

Index NumCells(const LearningProblem& problem) {
  return problem.input_shape[1] * problem.input_shape[2];
}

// At most kMaxNumRuns, from the lowest metric or, without one, the lowest loss;
// a value that is not a number is last.
std::vector<const LearningRunResult*> BestRuns(
    const LearningProblem& problem,
    std::vector<const LearningRunResult*> runs) {
  const auto score = problem.metric.has_value() ? &HistoryRow::metric
                                                : &HistoryRow::train_loss;
  const auto is_lower = [score](const LearningRunResult* a,
                                const LearningRunResult* b) {
    const double value = a->last().*score, other = b->last().*score;
    return value < other || (std::isnan(other) && !std::isnan(value));
  };
  std::stable_sort(runs.begin(), runs.end(), is_lower);
  runs.resize(std::min(runs.size(), kMaxNumRuns));
  return runs;
}

std::vector<std::string> ShortNamesOf(
    const std::vector<const LearningRunResult*>& runs) {
  std::vector<std::string> labels;
  labels.reserve(runs.size());
  for (const LearningRunResult* run : runs) labels.push_back(run->label);
  return ShortNames(labels);
}

// The panels of a sample's fields.
class FieldPanels {
 public:
  explicit FieldPanels(const LearningProblem& problem)
      : problem_(problem),
        samples_(problem.test.num_samples() > 0 ? problem.test : problem.train),
        num_cells_(NumCells(problem)),
        y_(samples_.targets.col(0)),
        x_(samples_.solutions.col(0)),
        num_columns_(static_cast<int>((y_.size() + x_.size()) / num_cells_)) {
    const VectorXd input = samples_.inputs.col(0);
    if (input.size() != y_.size() || input != y_) {
      Add("input", input, input);
      FillRow();
    }
    Add("y*", y_, y_);
    Add("x*", x_, x_);
  }

  // y and x of a network, if both have values.
  void AddNetwork(const std::string& label, const VectorXd& weights) {
    const Model& model = *problem_.model;
    const auto pass = model.network().NewPass();
    std::string ignored;
    VectorXd y(y_.size());
    if (!model.Forward(weights,
                       samples_,
                       Network::Derivatives::kNone,
                       pass.get(),
                       &ignored)) {
      return;
    }
    const VectorXd x = pass->outputs.col(0);
    if (!model.simulator().Evaluate(
            x.data(), samples_.Context(0).data(), y.data(), nullptr)) {
      return;
    }
    Add(label + ", y", y, y_);
    Add(label + ", x", x, x_);
  }

  Picture Take(const std::string& path_png) {
    return {path_png, std::move(panels_), num_columns_};
  }

 private:
  // A panel for each channel.
  void Add(const std::string& title,
           const VectorXd& fields,
           const VectorXd& reference) {
    const Index num_channels = fields.size() / num_cells_;
    for (Index c = 0; c < num_channels; ++c) {
      panels_.push_back(
          FieldPlot(num_channels > 1 ? fmt::format("{}_{}", title, c) : title,
                    static_cast<int>(problem_.input_shape[1]),
                    fields.segment(c * num_cells_, num_cells_),
                    reference.segment(c * num_cells_, num_cells_)));
    }
  }

  void FillRow() {
    while (panels_.size() % num_columns_ != 0) panels_.emplace_back();
  }

  const LearningProblem& problem_;
  const DataSet& samples_;
  const Index num_cells_;
  const VectorXd y_;  // y*
  const VectorXd x_;  // x*
  const int num_columns_;
  std::vector<Plot> panels_;
};

}  // namespace

Plot FieldPlot(const std::string& title,
               int rows,
               const VectorXd& field,
               const VectorXd& reference) {
  Plot plot;
  plot.title = title;
  plot.equal_aspect = true;
  HeatMap& map = plot.heat_map.emplace();
  map.z = field.reshaped<Eigen::RowMajor>(rows, field.size() / rows);
  map.z_range = {reference.minCoeff(), reference.maxCoeff()};
  return plot;
}

bool HasFields(const LearningProblem& problem) {
  if (problem.input_shape.size() != 3 || problem.input_shape[1] < 2) {
    return false;
  }
  const DataSet& samples = problem.train;
  const Index num_cells = NumCells(problem);
  return problem.model->num_calls() == 1 && samples.solutions.size() > 0 &&
         samples.targets.rows() % num_cells == 0 &&
         samples.solutions.rows() % num_cells == 0;
}

Picture FieldsPicture(const LearningProblem& problem,
                      const std::string& path_png,
                      const VectorXd& initial_weights,
                      const std::vector<const LearningRunResult*>& runs) {
  FieldPanels panels(problem);
  panels.AddNetwork("initial weights", initial_weights);
  const std::vector<const LearningRunResult*> best = BestRuns(problem, runs);
  const std::vector<std::string> names = ShortNamesOf(best);
  for (size_t i = 0; i < best.size(); ++i) {
    panels.AddNetwork(names[i], best[i]->weights);
  }
  return panels.Take(path_png);
}

void AddFunctionPanels(const std::string& title,
                       int rows,
                       const VectorXd& function,
                       const VectorXd* truth,
                       Picture* picture) {
  const VectorXd& reference = truth == nullptr ? function : *truth;
  Plot& panel =
      picture->panels.emplace_back(FieldPlot(title, rows, function, reference));
  const auto label = [](Plot* plot) {
    plot->equal_aspect = false;
    plot->x_label = "second coordinate, point";
    plot->y_label = "first coordinate, point";
  };
  label(&panel);
  if (truth == nullptr) return;
  const VectorXd error = (function - *truth).cwiseAbs();
  Plot& of_error =
      picture->panels.emplace_back(FieldPlot("|u - u*|", rows, error, error));
  label(&of_error);
  of_error.heat_map->log_z = true;
  // Where u holds exactly, the error is rounding.
  of_error.heat_map->z_range = {1e-4 * error.maxCoeff(), error.maxCoeff()};
}

Picture FunctionPicture(const LearningProblem& problem,
                        const std::string& path_png,
                        const std::vector<const LearningRunResult*>& runs) {
  const FunctionOnGrid& function = *problem.function_on_grid;
  Picture picture = {path_png, {}, 2};
  const VectorXd truth = function.truth();
  AddFunctionPanels("u*", function.rows, truth, nullptr, &picture);
  picture.panels.emplace_back();
  const std::vector<const LearningRunResult*> best = BestRuns(problem, runs);
  const std::vector<std::string> names = ShortNamesOf(best);
  for (size_t i = 0; i < best.size(); ++i) {
    const auto pass = problem.model->network().NewPass();
    std::string ignored;
    if (!problem.model->Forward(best[i]->weights,
                                problem.test,
                                Network::Derivatives::kNone,
                                pass.get(),
                                &ignored)) {
      continue;
    }
    AddFunctionPanels(
        names[i],
        function.rows,
        function.values(problem.model->SimulatorInputs(*pass), problem.test),
        &truth,
        &picture);
  }
  return picture;
}

}  // namespace invgrad
