#include "bin/estimate/estimation_comparison.h"

#include <cstdint>
#include <iostream>
#include <utility>

#include "bin/estimate/estimation_report.h"
#include "bin/estimate/estimation_results.h"
#include "bin/estimate/estimation_run.h"
#include "bin/estimate/estimation_table.h"
#include "bin/estimate/way.h"
#include "bin/support/html_output.h"
#include "bin/support/output_options.h"
#include "bin/support/program.h"
#include "bin/support/ranks.h"
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

// Where all ways start.
struct Start {
  const EstimationInput* input = nullptr;
  int number = 0;  // of the input's starts
  int seed = 0;    // of the noise
  std::string name;

  Estimation* estimation() const { return input->estimation.get(); }
};

std::string StartName(const EstimationOptions& options, const Start& start) {
  const EstimationTraits& traits = start.estimation()->traits();
  std::string name = start.input->name;
  if (!traits.seeds.empty()) {
    name += fmt::format("-seed{}", traits.seeds[start.number]);
  } else if (traits.num_starts > 1) {
    name += fmt::format("-start{}", start.number + 1);
  }
  if (options.perturb > 0.0) name += fmt::format("-seed{}", start.seed);
  return name;
}

std::vector<Start> StartsOf(const EstimationOptions& options,
                            const std::vector<EstimationInput>& inputs) {
  std::vector<Start> starts;
  for (const EstimationInput& input : inputs) {
    const EstimationTraits& traits = input.estimation->traits();
    for (int k = 0; k < traits.num_starts; ++k) {
      if (traits.seeds.empty() && options.start != "both" &&
          options.start != std::to_string(k + 1)) {
        continue;
      }
      for (const int seed :
           options.perturb > 0.0 ? options.seeds : std::vector<int>{0}) {
        Start start{&input, k, seed, ""};
        start.name = StartName(options, start);
        starts.push_back(std::move(start));
      }
    }
  }
  return starts;
}

void SetStart(const EstimationOptions& options, const Start& start) {
  start.estimation()->SetStart(start.number);
  if (options.perturb > 0.0) {
    NumpyRandom random(static_cast<std::uint32_t>(start.seed));
    start.estimation()->Perturb(options.perturb, &random);
  }
}

// Adds a run, and what it draws.
bool AddRun(const EstimationOptions& options,
            const Start& start,
            const Way& way,
            Panels* panels,
            Runs* runs,
            std::string* error) {
  SetStart(options, start);
  EstimationRun run;
  const bool is_good = RunOrReadEstimation(options,
                                           start.name,
                                           way,
                                           !Interrupt::IsRequested(),
                                           start.estimation(),
                                           &run,
                                           error);
  if (run.row.status.empty()) return is_good;
  run.row.input = start.input->name;
  if (!run.report.minimizer.iterations.empty()) {
    start.estimation()->Draw(way.label, &panels->results);
    if (run.report.covariance) {
      start.estimation()->DrawCovariance(
          way.label, *run.report.covariance, &panels->covariances);
    }
    AddCosts(way.label, panels->color, run.report.minimizer, &panels->costs);
  }
  runs->rows.push_back(std::move(run.row));
  return is_good;
}

// All ways from one start. Adds nothing after a signal if none was run before.
bool RunFrom(const EstimationOptions& options,
             const Start& start,
             const std::vector<Way>& ways,
             Runs* runs,
             std::string* error) {
  const std::string& name = start.name;
  const std::string folder = InOutput(name);
  SetStart(options, start);
  Panels panels;
  start.estimation()->Draw("start", &panels.results);
  const size_t num_before = runs->rows.size();
  for (const Way& way : ways) {
    panels.color = static_cast<int>(&way - ways.data());
    if (!AddRun(options, start, way, &panels, runs, error)) return false;
  }
  if (runs->rows.size() == num_before) return true;
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
    const EstimationTraits& traits = input.estimation->traits();
    const bool has_second = traits.num_starts == 2 && traits.seeds.empty();
    if (options.start != "2" || has_second) continue;
    *error = "--start=2: " + input.name + " has one start";
    return false;
  }
  return CheckResume(options.resume, error);
}

bool Prepare(const EstimationOptions& options,
             const std::vector<EstimationInput>& inputs,
             const std::vector<Start>& starts,
             const std::vector<Way>& ways,
             std::string* error) {
  for (const EstimationInput& input : inputs) {
    std::cout << input.name << ": " << input.estimation->traits().description
              << "\n";
  }
  std::cout << "\n";
  SetBlasThreads(options.threads);
  if (!PrepareRunDirectoryOnRanks(options.resume ? ExistingDirectory::kResume
                                                 : ExistingDirectory::kRefuse,
                                  RunIdentity(),
                                  error)) {
    return false;
  }
  bool is_listed = true;  // before other ranks write some of them
  for (const Start& start : starts) {
    for (const Way& way : ways) {
      is_listed = is_listed &&
                  (!IsFirstRank() ||
                   ListEstimationRun(
                       options, start.name, way, *start.estimation(), error));
    }
  }
  return AgreeOnRanks(is_listed, error);
}

// The runs of this rank, for their files.
bool RunShare(const EstimationOptions& options,
              const std::vector<Start>& starts,
              const std::vector<Way>& ways,
              std::string* error) {
  const auto run = [&](int number) {
    const Start& start = starts[number / ways.size()];
    SetStart(options, start);
    EstimationRun ignored;
    return RunOrReadEstimation(options,
                               start.name,
                               ways[number % ways.size()],
                               /*may_run=*/true,
                               start.estimation(),
                               &ignored,
                               error);
  };
  return RunShareOfRank(
      static_cast<int>(starts.size() * ways.size()), run, error);
}

bool Run(const EstimationOptions& options,
         const std::vector<EstimationInput>& inputs,
         const std::vector<Start>& starts,
         const std::vector<Way>& ways,
         Runs* runs,
         std::string* error) {
  LiveReport live;
  for (const Start& start : starts) {
    live.Update([&] {
      return EstimationReport(
          options, inputs, ways, runs->rows, runs->costs, false);
    });
    if (!RunFrom(options, start, ways, runs, error)) return false;
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
  std::cout << "results in " << Output().output << "\n";
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
  const std::vector<Start> starts = StartsOf(options, inputs);
  const std::vector<Way> ways = Ways(methods, options.separable);
  if (!Check(options, inputs, error) ||
      !Prepare(options, inputs, starts, ways, error)) {
    return false;
  }
  const Interrupt interrupt(/*is_silent=*/!IsFirstRank());
  if (!RunShare(options, starts, ways, error)) return false;
  if (!IsFirstRank()) return true;
  Runs runs;
  if (!Run(options, inputs, starts, ways, &runs, error) ||
      !Report(options, inputs, ways, runs, error)) {
    return false;
  }
  for (const EstimationRow& row : runs.rows) counts->Add(!row.has_failed);
  return true;
}

}  // namespace invgrad
