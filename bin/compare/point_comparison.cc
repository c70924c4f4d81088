#include "bin/compare/point_comparison.h"

#include <algorithm>
#include <iostream>
#include <limits>
#include <utility>

#include "bin/compare/point_report.h"
#include "bin/support/field_plots.h"
#include "bin/support/html_output.h"
#include "bin/support/output_options.h"
#include "bin/support/point_path.h"
#include "bin/support/point_run.h"
#include "bin/support/ranks.h"
#include "bin/support/run_output.h"
#include "fmt/ranges.h"
#include "invgrad/io/format.h"
#include "invgrad/method.h"
#include "invgrad/npy.h"
#include "report/interrupt.h"
#include "report/plot.h"
#include "report/table.h"

namespace invgrad {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// A method that could not run has no points.
Table PointTable(const PointProblem& problem,
                 const std::vector<PointPath>& paths) {
  const bool is_printed = problem.start.size() <= kMaxPrintedSize;
  Table table;
  for (const PointPath& path : paths) {
    const bool has_run = !path.x.empty();
    const auto add = [&](const std::string& title, const std::string& cell) {
      table.Add(title, has_run ? cell : "-");
    };
    const Eigen::VectorXd& x = has_run ? path.x.back() : problem.start;
    table.BeginRow();
    table.Add("method", path.label, Table::Align::kLeft);
    add("steps", std::to_string(path.x.size() - 1));
    add("L at start", FormatNumber(has_run ? path.loss.front() : kNan));
    add("L", FormatNumber(has_run ? path.loss.back() : kNan));
    if (is_printed) {
      add("x", fmt::format("({:.6g})", fmt::join(x.begin(), x.end(), ", ")));
    } else {
      add("|x|", FormatNumber(x.norm()));
    }
    const Eigen::VectorXd error =
        problem.minimizer.has_value()
            ? Eigen::VectorXd(x - *problem.minimizer)
            : Eigen::VectorXd::Constant(x.size(), kNan);
    add("|x - x*|", NumberOrDash(error.norm()));
    if (!is_printed) {
      add("mean |x - x*|", NumberOrDash(error.cwiseAbs().mean()));
    }
    if (!problem.simulator->forms_jacobian()) {
      add("calls", FormatNumber(has_run ? path.calls.back() : kNan));
    }
    add("s", FormatNumber(path.summary.total_time_in_seconds));
    table.Add("status", path.status, Table::Align::kLeft);
  }
  return table;
}

// The results of the runs if x is too large to print; fields for `panels`.
bool WriteFinalStates(const PointProblem& problem,
                      const std::vector<PointPath>& paths,
                      std::vector<Plot>* panels,
                      std::string* error) {
  Eigen::VectorXd colours_of;
  const auto add = [&](const std::string& title,
                       const std::string& file,
                       const Eigen::VectorXd& x) {
    if (problem.field_rows > 0) {
      // All panels have the colours of the first.
      if (panels->empty()) colours_of = x;
      panels->push_back(FieldPlot(title, problem.field_rows, x, colours_of));
    }
    const std::string path = InOutput(fmt::format("x-{}.npy", file));
    return ListRunFile(path, error) && WriteNpy(path, x, error);
  };
  if (problem.minimizer.has_value() && !add("x*", "true", *problem.minimizer)) {
    return false;
  }
  for (const PointPath& path : paths) {
    if (!path.x.empty() &&
        !add(path.label, FileName(path.label), path.x.back())) {
      return false;
    }
  }
  return true;
}

Plot LossPlot(const std::vector<PointPath>& paths) {
  Plot plot;
  plot.title = "loss";
  plot.x_label = "step";
  plot.y_label = "L";
  plot.log_y = true;
  std::vector<std::string> labels;
  labels.reserve(paths.size());
  for (const PointPath& path : paths) labels.push_back(path.label);
  const std::vector<std::string> names = ShortNames(labels);
  for (size_t i = 0; i < paths.size(); ++i) {
    if (paths[i].x.empty()) continue;
    Series& series = plot.series.emplace_back();
    series.title = names[i];
    series.color = static_cast<int>(i);
    series.y = paths[i].loss;
    for (size_t k = 0; k < series.y.size(); ++k) {
      series.x.push_back(static_cast<double>(k));
    }
  }
  return plot;
}

bool Check(CompareOptions* options,
           const PointProblem& problem,
           size_t num_methods,
           MinimizerOptions* minimizer,
           std::string* error) {
  if (!CheckNoTraining(/*takes_threads=*/false, error) ||
      !CheckNotGiven({"seeds", "levels"},
                     "needs a problem with a network or a ceres::Problem",
                     error) ||
      !CheckResume(options->resume, error)) {
    return false;
  }
  *minimizer = PointBudget();
  options->training.SetBudget(minimizer);
  options->training.steps = minimizer->max_num_iterations;  // for flags.txt
  return PathsFitInMemory(
      problem, minimizer->max_num_iterations, num_methods, error);
}

std::string Prefix() { return InOutput("path-"); }

bool Prepare(const CompareOptions& options,
             const std::vector<Method>& methods,
             std::string* error) {
  if (!PrepareRunDirectoryOnRanks(options.resume ? ExistingDirectory::kResume
                                                 : ExistingDirectory::kRefuse,
                                  RunIdentity(),
                                  error)) {
    return false;
  }
  bool is_listed = true;  // before other ranks write some of them
  for (const Method& method : methods) {
    is_listed =
        is_listed && (!IsFirstRank() || ListPointRun(Prefix(), method, error));
  }
  return AgreeOnRanks(is_listed, error);
}

// The runs of this rank, for their files.
bool RunShare(const PointProblem& problem,
              const std::vector<Method>& methods,
              const MinimizerOptions& options,
              std::string* error) {
  const auto run = [&](int i) {
    PointPath ignored;
    return RunOrReadPath(Prefix(),
                         problem,
                         methods[i],
                         options,
                         /*may_run=*/true,
                         &ignored,
                         error);
  };
  return RunShareOfRank(static_cast<int>(methods.size()), run, error);
}

bool Run(const PointProblem& problem,
         const std::vector<Method>& methods,
         const MinimizerOptions& options,
         std::vector<PointPath>* paths,
         RunCounts* counts,
         std::string* error) {
  LiveReport live;
  for (const Method& method : methods) {
    live.Update([&] {
      const Table table = PointTable(problem, *paths);
      return PointReport(problem, methods, *paths, table, /*is_over=*/false);
    });
    PointPath path;
    if (!RunOrReadPath(Prefix(),
                       problem,
                       method,
                       options,
                       !Interrupt::IsRequested(),
                       &path,
                       error)) {
      return false;
    }
    if (path.status.empty()) path.status = "not run: interrupted";
    counts->Add(!path.has_failed());
    paths->push_back(std::move(path));
  }
  return true;
}

bool Report(const PointProblem& problem,
            const std::vector<Method>& methods,
            const std::vector<PointPath>& paths,
            std::string* error) {
  const Table table = PointTable(problem, paths);
  std::cout << table.ToText();
  std::vector<Plot> fields;
  if (!WriteTable(InOutput("table"), table, error) ||
      (problem.start.size() > kMaxPrintedSize &&
       !WriteFinalStates(problem, paths, &fields, error))) {
    return false;
  }
  std::cout << "results in " << Output().output << "\n";
  FinishReport(PointReport(problem, methods, paths, table, /*is_over=*/true),
               {{InOutput("fields.png"),
                 fields,
                 0,
                 "The final x of each method as a field, beside x* if it is "
                 "known, in the same colours."},
                {InOutput("loss.png"), {LossPlot(paths)}}});
  return true;
}

}  // namespace

bool ComparePoint(CompareOptions* options,
                  const PointProblem& problem,
                  const std::vector<Method>& methods,
                  RunCounts* counts,
                  std::string* error) {
  MinimizerOptions minimizer;
  if (!AgreeOnRanks(Check(options, problem, methods.size(), &minimizer, error),
                    error) ||
      !Prepare(*options, methods, error)) {
    return false;
  }
  const Interrupt interrupt(/*is_silent=*/!IsFirstRank());
  if (!RunShare(problem, methods, minimizer, error)) return false;
  if (!IsFirstRank()) return true;
  std::vector<PointPath> paths;
  return Run(problem, methods, minimizer, &paths, counts, error) &&
         Report(problem, methods, paths, error);
}

}  // namespace invgrad
