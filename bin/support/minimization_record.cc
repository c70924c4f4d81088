#include "bin/support/minimization_record.h"

#include <filesystem>

#include "bin/support/run_directory.h"
#include "invgrad/train/checkpoint.h"

namespace invgrad {
namespace {

// Any bytes.
void VisitText(const std::string& name,
               std::string* text,
               StateArchive* archive) {
  Eigen::VectorXd bytes(text->size());
  for (Eigen::Index i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<unsigned char>((*text)[i]);
  }
  archive->Visit(name, &bytes);
  constexpr double kMaxByte = 255.0;
  archive->Require(AreCounts(bytes, kMaxByte), name);
  if (!archive->error().empty()) return;
  text->clear();
  for (const double byte : bytes) *text += static_cast<char>(byte);
}

void VisitIterations(std::vector<ceres::IterationSummary>* iterations,
                     StateArchive* archive) {
  constexpr int kNumFields = 4;
  Eigen::VectorXd table(kNumFields * iterations->size());
  for (size_t i = 0; i < iterations->size(); ++i) {
    const ceres::IterationSummary& iteration = (*iterations)[i];
    table.segment<kNumFields>(kNumFields * i) << iteration.iteration,
        iteration.cost, iteration.cumulative_time_in_seconds,
        iteration.step_is_successful ? 1.0 : 0.0;
  }
  archive->Visit("iterations", &table);
  archive->Require(table.size() % kNumFields == 0, "iterations");
  if (!archive->error().empty()) return;
  iterations->resize(table.size() / kNumFields);
  for (size_t i = 0; i < iterations->size(); ++i) {
    const auto fields = table.segment<kNumFields>(kNumFields * i);
    ceres::IterationSummary& iteration = (*iterations)[i];
    iteration.iteration = static_cast<int>(fields[0]);
    iteration.cost = fields[1];
    iteration.cumulative_time_in_seconds = fields[2];
    iteration.step_is_successful = fields[3] != 0.0;
  }
}

void VisitPoints(Eigen::MatrixXd* points, StateArchive* archive) {
  Eigen::Index num_points = points->cols();
  Eigen::VectorXd values = points->reshaped();
  archive->Visit("num_points", &num_points);
  archive->Visit("points", &values);
  archive->Require(
      num_points > 0 ? values.size() % num_points == 0 : values.size() == 0,
      "points");
  if (!archive->error().empty()) return;
  *points = values.reshaped(num_points > 0 ? values.size() / num_points : 0,
                            num_points);
}

void VisitRecord(MinimizationRecord* record, StateArchive* archive) {
  MinimizerSummary& summary = record->summary;
  auto type = static_cast<int>(summary.termination_type);
  double num_evaluations = static_cast<double>(record->num_evaluations);
  int has_failed = record->has_failed ? 1 : 0;
  archive->Visit("termination_type", &type);
  archive->Visit("initial_cost", &summary.initial_cost);
  archive->Visit("final_cost", &summary.final_cost);
  archive->Visit("seconds", &summary.total_time_in_seconds);
  archive->Visit("num_outside_domain", &summary.num_outside_domain);
  archive->Visit("num_evaluations", &num_evaluations);
  archive->Visit("has_failed", &has_failed);
  VisitText("message", &summary.message, archive);
  VisitText("status", &record->status, archive);
  VisitIterations(&summary.iterations, archive);
  VisitPoints(&record->points, archive);
  summary.termination_type = static_cast<ceres::TerminationType>(type);
  record->num_evaluations = static_cast<long>(num_evaluations);
  record->has_failed = has_failed != 0;
}

// The limits that the run had, and has now.
struct Budget {
  double num_iterations = 0.0;
  double seconds = 0.0;

  void Visit(StateArchive* archive) {
    archive->Visit("max_num_iterations", &num_iterations);
    archive->Visit("max_seconds", &seconds);
  }
};

Budget BudgetOf(const MinimizerOptions& options) {
  return {static_cast<double>(options.max_num_iterations),
          options.max_time_in_seconds};
}

}  // namespace

bool WriteRecord(const std::string& path,
                 const RunIdentity& identity,
                 const MinimizerOptions& budget,
                 MinimizationRecord record,
                 std::string* error) {
  if (record.summary.termination_type == ceres::USER_SUCCESS) return true;
  StateArchive archive;
  BudgetOf(budget).Visit(&archive);
  VisitRecord(&record, &archive);
  return ListRunFile(path, error) && archive.Write(path, identity, error);
}

bool ReadRecord(const std::string& path,
                const RunIdentity& identity,
                const MinimizerOptions& budget,
                MinimizationRecord* record,
                std::string* error) {
  error->clear();
  std::error_code failure;
  if (!std::filesystem::exists(path, failure)) return false;
  StateArchive archive = StateArchive::Read(path, identity);
  const Budget now = BudgetOf(budget);
  Budget before;
  before.Visit(&archive);
  VisitRecord(record, &archive);
  *error = archive.error();
  const bool has_budget_left =
      record->summary.termination_type == ceres::NO_CONVERGENCE &&
      (now.num_iterations > before.num_iterations ||
       now.seconds > before.seconds);
  return error->empty() && !has_budget_left;
}

}  // namespace invgrad
