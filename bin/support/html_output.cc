#include "bin/support/html_output.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <utility>

#include "bin/support/output_options.h"
#include "bin/support/program.h"
#include "bin/support/versions.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/compare/compare.h"
#include "invgrad/methods/ceres_methods.h"
#include "report/plot.h"

namespace invgrad {
namespace {

std::string Now() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char text[64];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M %Z", &local);
  return text;
}

std::string Command() {
  std::string command;
  for (const std::string& word : gflags::GetArgvs()) {
    command += (command.empty() ? "" : " ") + QuoteForShell(word);
  }
  return command;
}

bool IsFirstOrder(const Phase& phase) {
  if (phase.pull_back != nullptr || phase.solves_output_layer()) return false;
  if (phase.ceres != nullptr) {
    return phase.rule == nullptr &&
           (phase.ceres->name == "ceres_nonlinear_cg" ||
            phase.ceres->name == "ceres_steepest_descent");
  }
  const LinearizationParts needs = phase.MakeRule()->Needs();
  return !needs.jacobian && !needs.hessian && !needs.hessian_times &&
         !needs.after;
}

void WriteReport(const HtmlReport& report) {
  std::string error;
  if (!WriteRunFile(InOutput("report.html"), ToHtml(report), &error)) {
    Warn(error);
  }
}

}  // namespace

HtmlReport NewReport(
    const std::string& subject,
    const std::string& question,
    const std::vector<std::string>& labels,
    const std::vector<std::pair<std::string, std::string>>& facts) {
  HtmlReport report;
  report.title =
      fmt::format("{}: {}", gflags::ProgramInvocationShortName(), subject);
  report.question = question;
  report.command = Command();
  const std::vector<std::string> names = ShortNames(labels);
  for (size_t i = 0; i < labels.size(); ++i) {
    report.methods.push_back({names[i], labels[i]});
  }
  report.facts = facts;
  report.facts.emplace_back("date", Now());
  std::string versions = CommitOfBuild();
  if (!versions.empty()) versions = "commit " + versions;
  for (const auto& [name, value] : Versions()) {
    versions +=
        fmt::format("{}{} {}", versions.empty() ? "" : "; ", name, value);
  }
  report.facts.emplace_back("run on", versions);
  return report;
}

std::vector<std::pair<std::string, std::string>> ProblemFacts() {
  const std::string specification =
      gflags::GetCommandLineFlagInfoOrDie("problem").current_value;
  std::vector<std::pair<std::string, std::string>> facts = {
      {"problem", specification}};
  const ProblemRow* row =
      FindProblem(specification.substr(0, specification.find(':')));
  if (row != nullptr) {
    facts.emplace_back("formula", row->equation);
    facts.emplace_back("source", row->source);
  }
  return facts;
}

bool IsFirstOrder(const Method& method) {
  return std::all_of(method.phases.begin(),
                     method.phases.end(),
                     [](const Phase& phase) { return IsFirstOrder(phase); });
}

void AddCurve(size_t method, Series curve, double at_start, Plot* view) {
  if (curve.x.empty()) return;
  constexpr double kRoom = 100.0;
  view->y_range.high =
      std::fmax(view->y_range.high.value_or(0.0), kRoom * at_start);
  curve.color = static_cast<int>(method);
  view->series.push_back(std::move(curve));
}

void LiveReport::Update(const std::function<HtmlReport()>& make) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point begin = Clock::now();
  if (begin < due_) return;
  WriteReport(make());
  const Clock::time_point end = Clock::now();
  due_ = end + std::max<Clock::duration>(std::chrono::seconds(10),
                                         20 * (end - begin));
}

std::string ProgressText(size_t num_done, size_t num_all) {
  return fmt::format(
      "{} of {} runs are done; this page reads itself again every 10 s.",
      num_done,
      num_all);
}

void FinishReport(HtmlReport report, const std::vector<Picture>& pictures) {
  WriteReport(report);
  DrawPictures(pictures);
  for (const Picture& picture : pictures) {
    if (!Output().plots || picture.caption.empty()) continue;
    report.images.push_back({picture.path_png, picture.caption});
  }
  if (!report.images.empty()) WriteReport(report);
}

}  // namespace invgrad
