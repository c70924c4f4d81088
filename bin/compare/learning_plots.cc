#include "bin/compare/learning_plots.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "bin/support/field_plots.h"
#include "fmt/core.h"
#include "report/plot.h"

namespace invgrad {
namespace {

using Runs = std::vector<const LearningRunResult*>;

std::vector<std::string> Names(const Runs& runs) {
  std::vector<std::string> labels;
  labels.reserve(runs.size());
  for (const LearningRunResult* run : runs) labels.push_back(run->label);
  return ShortNames(labels);
}

Plot CurvePlot(const Runs& runs,
               const std::string& value,
               double HistoryRow::*field,
               bool against_seconds) {
  Plot plot;
  plot.title = value + (against_seconds ? " by seconds" : " by steps");
  plot.y_label = value;
  plot.x_label = against_seconds ? "seconds of training" : "step";
  plot.log_x = plot.log_y = true;
  const std::vector<std::string> names = Names(runs);
  for (size_t i = 0; i < runs.size(); ++i) {
    plot.series.push_back(
        HistoryCurve(names[i], runs[i]->history, field, against_seconds));
  }
  return plot;
}

// A line below the curves.
Series Floor(const Plot& plot, double value) {
  double first = HistoryRow::kNone, last = HistoryRow::kNone;
  for (const Series& series : plot.series) {
    for (const double x : series.x) {
      first = std::fmin(first, x);
      last = std::fmax(last, x);
    }
  }
  Series line;
  line.title = "floor";
  line.x = {first, last};
  line.y = {value, value};
  return line;
}

std::vector<Plot> LossPlots(const LearningProblem& problem, const Runs& runs) {
  // Uses the test loss if there is one.
  const bool has_test_data = problem.test.num_samples() > 0;
  const std::string title = has_test_data ? "test loss" : "train loss";
  const auto loss =
      has_test_data ? &HistoryRow::test_loss : &HistoryRow::train_loss;
  std::vector<Plot> plots = {CurvePlot(runs, title, loss, false),
                             CurvePlot(runs, title, loss, true)};
  if (problem.metric.has_value()) {
    plots.push_back(
        CurvePlot(runs, problem.metric->name, &HistoryRow::metric, true));
  }
  if (problem.metric.has_value() && problem.metric->floor.has_value()) {
    plots.back().series.push_back(Floor(plots.back(), *problem.metric->floor));
  }
  return plots;
}

std::vector<Plot> NeuronPlots(const Runs& runs) {
  std::vector<Plot> plots;
  const std::vector<std::string> names = Names(runs);
  for (size_t k = 0; k < runs.size(); ++k) {
    const LearningRunResult* run = runs[k];
    if (run->neurons.empty()) continue;
    Plot& plot = plots.emplace_back();
    plot.title = names[k];
    plot.x_label = "step";
    plot.y_label = "mean activation";
    plot.log_x = true;
    int layer = 0;
    for (size_t j = 0; j < run->neurons.front().size(); ++j) {
      Series& series = plot.series.emplace_back();
      series.color = run->neurons.front()[j].layer - 1;
      if (run->neurons.front()[j].layer != layer) {
        layer = run->neurons.front()[j].layer;
        series.title = fmt::format("layer {}", layer);
      }
      for (size_t i = 0; i < run->neurons.size(); ++i) {
        if (run->history[i].step == 0) continue;
        series.x.push_back(static_cast<double>(run->history[i].step));
        series.y.push_back(run->neurons[i][j].mean);
      }
    }
  }
  return plots;
}

Plot SamplePathPlot(const LearningProblem& problem,
                    int tracked_sample,
                    const Runs& runs) {
  Plot plot;
  plot.title = fmt::format("training sample {} in y space", tracked_sample);
  plot.x_label = "y_0";
  plot.y_label = "y_1";
  const auto add = [&plot](const std::string& title, const auto& path) {
    if (path.empty()) return;
    Series& series = plot.series.emplace_back();
    series.title = title;
    for (const Eigen::VectorXd& y : path) {
      series.x.push_back(y[0]);
      series.y.push_back(y[1]);
    }
  };
  const std::vector<std::string> names = Names(runs);
  for (size_t i = 0; i < runs.size(); ++i) add(names[i], runs[i]->sample_path);
  const std::vector<Eigen::VectorXd> target = {
      problem.train.targets.col(tracked_sample)};
  add("target", target);
  plot.series.back().style = Series::Style::kPoints;
  return plot;
}

// The mean activation in the band of its deviation, against steps.
Plot ActivationPlot(const LearningRunResult& run) {
  Plot plot;
  plot.x_label = "step";
  plot.y_label = "activation, mean and deviation";
  plot.log_x = true;
  Series& series = plot.series.emplace_back();
  for (size_t i = 0; i < run.neurons.size(); ++i) {
    const PooledActivation pooled = PoolActivations(run.neurons[i]);
    series.x.push_back(static_cast<double>(run.history[i].step));
    series.y.push_back(pooled.mean);
    series.y_low.push_back(pooled.mean - pooled.deviation);
    series.y_high.push_back(pooled.mean + pooled.deviation);
  }
  return plot;
}

// The range of the values, and a quarter of it on both sides.
AxisRange Window(const Eigen::VectorXd& values) {
  const double margin = 0.25 * (values.maxCoeff() - values.minCoeff());
  return {values.minCoeff() - margin, values.maxCoeff() + margin};
}

// The same axes for all methods: loss, activation, sample path, which may leave
// the window of the targets of all samples.
std::vector<Plot> MethodPlots(const LearningProblem& problem,
                              int tracked_sample,
                              const Runs& runs) {
  std::vector<Plot> plots;
  std::vector<double> losses, activations;
  const auto append = [](const std::vector<double>& from,
                         std::vector<double>* to) {
    to->insert(to->end(), from.begin(), from.end());
  };
  const std::vector<std::string> names = Names(runs);
  for (size_t k = 0; k < runs.size(); ++k) {
    const LearningRunResult& run = *runs[k];
    if (run.neurons.empty() || run.sample_path.empty()) continue;
    if (run.neurons.front().empty()) continue;  // no dense layers
    Plot panels[] = {
        CurvePlot({&run}, "train loss", &HistoryRow::train_loss, false),
        ActivationPlot(run),
        SamplePathPlot(problem, tracked_sample, {&run})};
    append(panels[0].series[0].y, &losses);
    append(panels[1].series[0].y_low, &activations);
    append(panels[1].series[0].y_high, &activations);
    panels[2].series.back().color = 6;  // the target, black for all methods
    for (Plot& panel : panels) {
      panel.title = names[k];
      panel.series[0].color = static_cast<int>(k);
      for (Series& series : panel.series) series.title.clear();
      plots.push_back(panel);
    }
  }
  for (size_t i = 0; i < plots.size(); i += 3) {
    plots[i].y_range = RangeOf(losses, true);
    plots[i + 1].y_range = RangeOf(activations, false);
    plots[i + 2].x_range = Window(problem.train.targets.row(0));
    plots[i + 2].y_range = Window(problem.train.targets.row(1));
  }
  return plots;
}

// The learned function of a network with one input and one output: x over the
// input, and the solutions of the data.
Plot MapPlot(const LearningProblem& problem, const Runs& runs) {
  const DataSet& data = problem.train;
  std::vector<int> order(data.num_samples());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int i, int j) {
    return data.inputs(0, i) < data.inputs(0, j);
  });
  const DataSet sorted = data.Select(order);
  Plot plot;
  plot.title = "learned map";
  plot.x_label = "network input";
  plot.y_label = "x";
  if (sorted.solutions.rows() == 1) {
    // Drawn first, behind the maps; some samples suffice.
    constexpr int kNumPoints = 200;
    Series& solutions = plot.series.emplace_back();
    solutions.title = "solutions";
    solutions.style = Series::Style::kPoints;
    const int spacing = 1 + sorted.num_samples() / kNumPoints;
    for (int s = 0; s < sorted.num_samples(); s += spacing) {
      solutions.x.push_back(sorted.inputs(0, s));
      solutions.y.push_back(sorted.solutions(0, s));
    }
  }
  const std::vector<std::string> names = Names(runs);
  for (size_t i = 0; i < runs.size(); ++i) {
    const auto pass = problem.model->network().NewPass();
    std::string ignored;
    if (!problem.model->Forward(runs[i]->weights,
                                sorted,
                                Network::Derivatives::kNone,
                                pass.get(),
                                &ignored)) {
      continue;
    }
    Series& series = plot.series.emplace_back();
    series.title = names[i];
    series.x.assign(sorted.inputs.data(),
                    sorted.inputs.data() + sorted.num_samples());
    series.y.assign(pass->outputs.data(),
                    pass->outputs.data() + sorted.num_samples());
  }
  return plot;
}

}  // namespace

std::vector<Picture> LearningPictures(const LearningProblem& problem,
                                      const std::string& directory,
                                      int tracked_sample,
                                      const Eigen::VectorXd& initial_weights,
                                      const Runs& runs) {
  std::vector<Picture> pictures = {
      {directory + "/loss.png", LossPlots(problem, runs)},
      {directory + "/neurons.png",
       NeuronPlots(runs),
       0,
       "Mean activations of the hidden neurons, a panel a method, a colour a "
       "layer. Neurons that reach -1 or 1 are saturated; lines that stay "
       "together have learned the same."}};
  if (problem.train.inputs.rows() == 1 &&
      problem.model->simulator().num_inputs() == 1) {
    pictures.push_back({directory + "/map.png",
                        {MapPlot(problem, runs)},
                        0,
                        "The learned map from the network's input to x, over "
                        "the solutions of the data, which it should hit."});
  }
  if (HasFields(problem)) {
    pictures.push_back(FieldsPicture(
        problem, directory + "/fields.png", initial_weights, runs));
    pictures.back().caption =
        "Fields of the first test sample: the data, the untrained network, "
        "then "
        "the methods. P(x) should look like y*, and x like x*.";
  }
  if (problem.function_on_grid.has_value()) {
    pictures.push_back(
        FunctionPicture(problem, directory + "/solution.png", runs));
    pictures.back().caption =
        "The true solution, then the solution of each method and its error.";
  }
  if (tracked_sample >= 0 && problem.train.targets.rows() >= 2) {
    pictures.push_back({directory + "/sample_path.png",
                        {SamplePathPlot(problem, tracked_sample, runs)},
                        0,
                        "The way of one training sample through y space in "
                        "training: a straight line to the target is best."});
    pictures.push_back(
        {directory + "/methods.png",
         MethodPlots(problem, tracked_sample, runs),
         3,
         "A row a method: the train loss, the mean activation of the hidden "
         "neurons in the band of its deviation (saturated: 1, no band), and "
         "the way of one training sample to its target, the square."});
  }
  return pictures;
}

}  // namespace invgrad
