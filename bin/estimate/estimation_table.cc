#include "bin/estimate/estimation_table.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "fmt/core.h"
#include "invgrad/io/format.h"
#include "problems/estimation/nist_models.h"

namespace invgrad {
namespace {

using Row = EstimationRow;
constexpr auto kLeft = Table::Align::kLeft;

bool HasDigits(const std::vector<Row>& rows) {
  return std::any_of(rows.begin(), rows.end(), [](const Row& row) {
    return row.digits.has_value();
  });
}

bool IsSolved(const Row& row) {
  return row.digits.has_value() && IsNistSolution(*row.digits);
}

// Counts of a run or of sums of runs, and seconds.
template <typename Counts>
void AddCounts(const Counts& counts, Table* table) {
  table->Add("iterations", std::to_string(counts.num_iterations));
  table->Add("accepted", std::to_string(counts.num_accepted));
  table->Add("rejected", std::to_string(counts.num_rejected));
}

// Sums over the runs of one method.
struct Sums {
  std::string method;
  int num_runs = 0;
  int num_solved = 0;
  int num_least = 0;
  double worst_digits = 0.0;  // of the solved runs
  double mean_digits = 0.0;
  long num_iterations = 0;
  long num_accepted = 0;
  long num_rejected = 0;
  double seconds = 0.0;

  void Add(const Row& row, double least_cost) {
    ++num_runs;
    if (row.final_cost <= least_cost + kSameCost * std::abs(least_cost)) {
      ++num_least;
    }
    if (IsSolved(row)) {
      ++num_solved;
      worst_digits += row.digits->minCoeff();
      mean_digits += row.digits->mean();
    }
    num_iterations += row.num_iterations;
    num_accepted += row.num_accepted;
    num_rejected += row.num_rejected;
    seconds += row.seconds;
  }
};

}  // namespace

Table EstimationTable(const std::vector<Row>& rows) {
  const bool has_digits = HasDigits(rows);
  Table table;
  for (const Row& row : rows) {
    table.BeginRow();
    table.Add("start", row.start, kLeft);
    table.Add("method", row.method, kLeft);
    table.Add("initial cost", FormatNumber(row.initial_cost, 7));
    table.Add("cost", FormatNumber(row.final_cost, 7));
    AddCounts(row, &table);
    table.Add("s", FormatNumber(row.seconds, 3));
    if (has_digits) {
      const bool is_known = row.digits.has_value();
      table.Add("digits",
                is_known ? FormatNumber(row.digits->minCoeff(), 3) : "-");
      table.Add("mean digits",
                is_known ? FormatNumber(row.digits->mean(), 3) : "-");
      table.Add("solved", !is_known ? "-" : IsSolved(row) ? "yes" : "no");
    }
    table.Add("status", row.status, kLeft);
  }
  return table;
}

Table EstimationSummary(const std::vector<Row>& rows) {
  std::map<std::string, double> least_cost;
  for (const Row& row : rows) {
    if (!std::isfinite(row.final_cost)) continue;
    const auto [it, is_new] = least_cost.emplace(row.start, row.final_cost);
    if (!is_new) it->second = std::min(it->second, row.final_cost);
  }
  std::vector<Sums> all;  // in the order of their first runs
  for (const Row& row : rows) {
    auto it = std::find_if(all.begin(), all.end(), [&row](const Sums& sums) {
      return sums.method == row.method;
    });
    if (it == all.end()) it = all.insert(all.end(), Sums{row.method});
    it->Add(row, least_cost[row.start]);
  }
  const bool has_digits = HasDigits(rows);
  Table table;
  for (const Sums& sums : all) {
    const auto mean = [&sums](double digits) {
      return sums.num_solved > 0 ? FormatNumber(digits / sums.num_solved, 3)
                                 : "-";
    };
    table.BeginRow();
    table.Add("method", sums.method, kLeft);
    table.Add("starts", std::to_string(sums.num_runs));
    table.Add("least cost",
              fmt::format("{} of {}", sums.num_least, sums.num_runs));
    if (has_digits) {
      table.Add("solved",
                fmt::format("{} of {}", sums.num_solved, sums.num_runs));
      table.Add("digits", mean(sums.worst_digits));
      table.Add("mean digits", mean(sums.mean_digits));
    }
    AddCounts(sums, &table);
    table.Add("s", FormatNumber(sums.seconds, 3));
  }
  return table;
}

std::string EstimationCsv(const std::vector<Row>& rows) {
  Table table;
  for (const Row& row : rows) {
    const bool is_known = row.digits.has_value();
    table.BeginRow();
    table.Add("start", row.start);
    table.Add("method", row.method);
    table.Add("initial_cost", ExactNumber(row.initial_cost));
    table.Add("final_cost", ExactNumber(row.final_cost));
    AddCounts(row, &table);
    table.Add("seconds", ExactNumber(row.seconds));
    table.Add("digits", is_known ? ExactNumber(row.digits->minCoeff()) : "");
    table.Add("mean_digits", is_known ? ExactNumber(row.digits->mean()) : "");
    table.Add("status", row.status);
  }
  return table.ToCsv();
}

}  // namespace invgrad
