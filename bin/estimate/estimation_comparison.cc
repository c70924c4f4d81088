#include "bin/estimate/estimation_comparison.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <optional>
#include <utility>

#include "bin/estimate/estimation_report.h"
#include "bin/estimate/estimation_results.h"
#include "bin/estimate/estimation_table.h"
#include "bin/estimate/run_report.h"
#include "bin/estimate/way.h"
#include "bin/support/html_output.h"
#include "bin/support/live_run.h"
#include "bin/support/program.h"
#include "bin/support/run_output.h"
#include "fmt/core.h"
#include "invgrad/blas_threads.h"
#include "invgrad/io/format.h"
#include "invgrad/method.h"
#include "invgrad/random.h"
#include "report/interrupt.h"
#include "report/plot.h"
#include "report/table.h"

namespace invgrad {
namespace {

struct Runs {
  std::vector<EstimationRow> rows;
  std::vector<StartCosts> costs;
  std::vector<Picture> pictures;  // drawn when all tables are written
};

// The panels of the pictures of a start.
struct Panels {
  Panels() : costs(2) {
    costs[0].x_label = "iteration";
    costs[1].x_label = "seconds";
    for (Plot& plot : costs) {
      plot.y_label = "cost";
      plot.log_y = true;
    }
  }

  void ShortenNames() {
    std::vector<std::string> labels;
    for (const Series& series : costs[0].series) {
      labels.push_back(series.title);
    }
    labels = ShortNames(labels);
    for (Plot& panel : costs) {
      for (size_t i = 0; i < labels.size(); ++i) {
        panel.series[i].title = labels[i];
      }
    }
  }

  std::vector<Plot> results;
  std::vector<Plot> covariances;
  std::vector<Plot> costs;  // against iterations and seconds
  int color = 0;            // of the next way
};

// Costs against iterations and against seconds. `color`: the number of the way.
void AddCosts(const std::string& label,
              int color,
              const MinimizerSummary& summary,
              std::vector<Plot>* panels) {
  Series iterations;
  iterations.title = label;
  iterations.color = color;
  Series seconds = iterations;
  for (const ceres::IterationSummary& iteration : summary.iterations) {
    iterations.x.push_back(iteration.iteration);
    seconds.x.push_back(iteration.cumulative_time_in_seconds);
  }
  iterations.y = seconds.y = Costs(summary);
  (*panels)[0].series.push_back(std::move(iterations));
  (*panels)[1].series.push_back(std::move(seconds));
}

std::string StartName(const EstimationOptions& options,
                      const EstimationInput& input,
                      int start,
                      int seed) {
  std::string name = input.name;
  if (input.estimation->traits().num_starts > 1) {
    name += fmt::format("-start{}", start + 1);
  }
  if (options.perturb > 0.0) name += fmt::format("-seed{}", seed);
  return name;
}

void SetStart(const EstimationOptions& options,
              int start,
              int seed,
              Estimation* estimation) {
  estimation->SetStart(start);
  if (options.perturb > 0.0) {
    NumpyRandom random(static_cast<std::uint32_t>(seed));
    estimation->Perturb(options.perturb, &random);
  }
}

bool Minimize(const EstimationOptions& options,
              const std::string& name,
              Way way,
              Estimation* estimation,
              ceres::Problem* problem,
              MinimizerSummary* summary,
              std::string* error) {
  MinimizerOptions minimizer = estimation->traits().budget;
  if (options.max_iterations > 0) {
    minimizer.max_num_iterations = options.max_iterations;
  }
  if (options.seconds > 0.0) minimizer.max_time_in_seconds = options.seconds;
  if (options.function_tolerance >= 0.0) {
    minimizer.function_tolerance = options.function_tolerance;
  }
  minimizer.block_name = [estimation](const double* values) {
    return estimation->BlockName(values);
  };
  minimizer.evaluation_callback = estimation->evaluation_callback();
  LiveCallback live(name + " " + way.label);
  minimizer.callbacks.push_back(&live);
  way.method.AddCeresDefaults(
      {{"linear_solver", estimation->traits().linear_solver},
       {"num_threads", std::to_string(options.threads)}});
  return MinimizeByWay(way, minimizer, estimation, problem, summary, error);
}

// Of a run that has a result. A covariance that cannot be computed is part of
// the status.
void SetCovariance(const ceres::Problem& problem,
                   const Estimation& estimation,
                   EstimationRow* row,
                   RunReport* report) {
  std::string why;
  if (!AddCovariance(estimation, problem, report, &why)) {
    row->status += "; no covariance: " + why;
    return;
  }
  row->rank = report->covariance->rank();
  row->num_parameters = report->covariance->num_parameters();
  row->deviation_digits = estimation.DeviationDigits(*report->covariance);
}

// Writes the result, in the input's format, and the reports.
bool WriteRun(const std::string& path,
              const Estimation& estimation,
              EstimationRow* row,
              RunReport* report,
              std::string* error) {
  const std::string result = path + estimation.traits().extension;
  if (!ListRunFile(result, error)) return false;
  // If estimates are not finite, the other runs continue.
  std::string why;
  if (!estimation.Write(result, &why)) {
    Warn(why);
    row->status += "; no result file: " + why;
    row->has_failed = true;
  }
  report->status = row->status;
  return WriteRunFile(path + ".csv", IterationsCsv(report->minimizer), error) &&
         WriteRunFile(path + ".json", report->ToJson(), error) &&
         (!report->covariance ||
          WriteRunFile(path + ".report.txt", report->ToText(), error));
}

// One way from one start. False only if a file cannot be written.
bool RunWay(const EstimationOptions& options,
            const std::string& name,
            const Way& way,
            Estimation* estimation,
            Panels* panels,
            EstimationRow* row,
            std::string* error) {
  row->start = name;
  row->method = way.label;
  RunReport report;
  report.start = name;
  report.method = way.label;
  const std::unique_ptr<ceres::Problem> problem =
      estimation->MakeProblem(options.make_loss);
  std::string why;
  if (!Minimize(options,
                name,
                way,
                estimation,
                problem.get(),
                &report.minimizer,
                &why)) {
    row->status = "not run: " + why;
    return true;
  }
  SetResults(way.method,
             report.minimizer,
             options.levels,
             *estimation,
             problem.get(),
             row);
  const std::string doubt = estimation->Doubt();
  if (!row->has_failed && !doubt.empty()) row->status += "; " + doubt;
  if (options.covariance && !row->has_failed) {
    SetCovariance(*problem, *estimation, row, &report);
  }
  row->estimate = estimation->EstimateText(
      report.covariance ? &*report.covariance : nullptr);
  if (!WriteRun(InOutput(name + "/" + FileName(way.label)),
                *estimation,
                row,
                &report,
                error)) {
    return false;
  }
  estimation->Draw(way.label, &panels->results);
  if (report.covariance) {
    estimation->DrawCovariance(
        way.label, *report.covariance, &panels->covariances);
  }
  AddCosts(way.label, panels->color, report.minimizer, &panels->costs);
  return true;
}

// All ways from one start.
bool RunFrom(const EstimationOptions& options,
             int start,
             int seed,
             const EstimationInput& input,
             const std::vector<Way>& ways,
             Runs* runs,
             std::string* error) {
  Estimation* estimation = input.estimation.get();
  const std::string name = StartName(options, input, start, seed);
  const std::string folder = InOutput(name);
  if (!MakeDirectories(folder, error)) return false;
  SetStart(options, start, seed, estimation);
  Panels panels;
  estimation->Draw("start", &panels.results);
  for (const Way& way : ways) {
    if (Interrupt::IsRequested()) break;
    SetStart(options, start, seed, estimation);
    panels.color = static_cast<int>(&way - ways.data());
    EstimationRow& row = runs->rows.emplace_back();
    row.input = input.name;
    if (!RunWay(options, name, way, estimation, &panels, &row, error)) {
      return false;
    }
  }
  runs->costs.push_back({name, panels.costs});
  panels.ShortenNames();
  constexpr size_t kMaxShown = 6;  // starts in the report
  const bool is_shown = runs->costs.size() <= kMaxShown;
  const auto caption = [&](const std::string& text) {
    return is_shown ? name + ": " + text : "";
  };
  runs->pictures.push_back({folder + "/result.png",
                            std::move(panels.results),
                            0,
                            caption("the start and every result.")});
  if (!panels.covariances.empty()) {
    runs->pictures.push_back(
        {folder + "/covariance.png",
         std::move(panels.covariances),
         0,
         caption("two standard deviations of every result.")});
  }
  if (!panels.costs[0].series.empty()) {
    runs->pictures.push_back({folder + "/cost.png", std::move(panels.costs)});
  }
  return true;
}

bool Check(const EstimationOptions& options,
           const std::vector<EstimationInput>& inputs,
           std::string* error) {
  for (const EstimationInput& input : inputs) {
    if (options.start != "2" || input.estimation->traits().num_starts == 2) {
      continue;
    }
    *error = "--start=2: " + input.name + " has one start";
    return false;
  }
  return true;
}

bool Prepare(const EstimationOptions& options,
             const std::vector<EstimationInput>& inputs,
             std::string* error) {
  for (const EstimationInput& input : inputs) {
    std::cout << input.name << ": " << input.estimation->traits().description
              << "\n";
  }
  std::cout << "\n";
  SetBlasThreads(options.threads);
  return PrepareRunDirectory(ExistingDirectory::kRefuse, error);
}

bool Run(const EstimationOptions& options,
         const std::vector<EstimationInput>& inputs,
         const std::vector<Way>& ways,
         Runs* runs,
         std::string* error) {
  LiveReport live;
  const std::vector<int> seeds =
      options.perturb > 0.0 ? options.seeds : std::vector<int>{0};
  for (const EstimationInput& input : inputs) {
    for (int start = 0; start < input.estimation->traits().num_starts;
         ++start) {
      if (options.start != "both" &&
          options.start != std::to_string(start + 1)) {
        continue;
      }
      for (const int seed : seeds) {
        if (Interrupt::IsRequested()) return true;
        live.Update([&] {
          return EstimationReport(
              options, inputs, ways, runs->rows, runs->costs, false);
        });
        if (!RunFrom(options, start, seed, input, ways, runs, error)) {
          return false;
        }
      }
    }
  }
  return true;
}

bool Report(const EstimationOptions& options,
            const std::vector<EstimationInput>& inputs,
            const std::vector<Way>& ways,
            const Runs& runs,
            std::string* error) {
  const std::vector<double>& levels = options.levels;
  const Table table = EstimationTable(runs.rows, levels, /*is_exact=*/false);
  const Table summary = EstimationSummary(runs.rows);
  std::cout << table.ToText() << "\n" << summary.ToText();
  for (const EstimationRow& row : runs.rows) {
    if (row.estimate.empty()) continue;
    std::cout << row.start << ", " << row.method << ": " << row.estimate
              << "\n";
  }
  if (!WriteTable(InOutput("table"), table, error) ||
      !WriteTable(InOutput("summary"), summary, error) ||
      !WriteRunFile(
          InOutput("results.csv"),
          EstimationTable(runs.rows, levels, /*is_exact=*/true).ToCsv(),
          error)) {
    return false;
  }
  std::cout << "results in " << FLAGS_output << "\n";
  FinishReport(
      EstimationReport(options, inputs, ways, runs.rows, runs.costs, true),
      runs.pictures);
  return true;
}

}  // namespace

bool CompareEstimations(const EstimationOptions& options,
                        const std::vector<EstimationInput>& inputs,
                        const std::vector<Method>& methods,
                        RunCounts* counts,
                        std::string* error) {
  if (!Check(options, inputs, error) || !Prepare(options, inputs, error)) {
    return false;
  }
  const Interrupt interrupt;
  Runs runs;
  const std::vector<Way> ways = Ways(methods, options.separable);
  if (!Run(options, inputs, ways, &runs, error) ||
      !Report(options, inputs, ways, runs, error)) {
    return false;
  }
  for (const EstimationRow& row : runs.rows) counts->Add(!row.has_failed);
  return true;
}

}  // namespace invgrad
