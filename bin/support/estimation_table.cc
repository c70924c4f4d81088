#include "bin/support/estimation_table.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <sstream>

#include "bin/support/csv_field.h"
#include "invgrad/io/format.h"
#include "problems/estimation/nist_models.h"

namespace invgrad {

namespace {

bool HasDigits(const std::vector<EstimationRow>& rows) {
  return std::any_of(rows.begin(), rows.end(), [](const EstimationRow& row) {
    return row.digits.has_value();
  });
}

bool IsSolved(const EstimationRow& row) {
  return row.digits.has_value() && IsNistSolution(*row.digits);
}

std::string Digits(double value) { return FormatNumber(value, 3); }

struct Sums {
  int num_runs = 0;
  int num_solved = 0;
  int num_least = 0;
  double worst_digits = 0.0;  // of the solved runs
  double mean_digits = 0.0;
  long num_iterations = 0;
  long num_accepted = 0;
  long num_rejected = 0;
  double seconds = 0.0;

  void Add(const EstimationRow& row, double least_cost) {
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

Table EstimationTable(const std::vector<EstimationRow>& rows) {
  const bool has_digits = HasDigits(rows);
  std::vector<Table::Column> columns = {{"start", Table::Align::kLeft},
                                        {"method", Table::Align::kLeft},
                                        {"initial cost"},
                                        {"cost"},
                                        {"iterations"},
                                        {"accepted"},
                                        {"rejected"},
                                        {"s"}};
  if (has_digits) {
    columns.insert(columns.end(), {{"digits"}, {"mean digits"}, {"solved"}});
  }
  columns.push_back({"status", Table::Align::kLeft});
  Table table(columns);
  for (const EstimationRow& row : rows) {
    std::vector<std::string> cells = {row.start,
                                      row.method,
                                      FormatNumber(row.initial_cost, 7),
                                      FormatNumber(row.final_cost, 7),
                                      std::to_string(row.num_iterations),
                                      std::to_string(row.num_accepted),
                                      std::to_string(row.num_rejected),
                                      FormatNumber(row.seconds, 3)};
    if (has_digits && row.digits.has_value()) {
      cells.push_back(Digits(row.digits->minCoeff()));
      cells.push_back(Digits(row.digits->mean()));
      cells.emplace_back(IsSolved(row) ? "yes" : "no");
    } else if (has_digits) {
      cells.insert(cells.end(), 3, "-");
    }
    cells.push_back(row.status);
    table.AddRow(std::move(cells));
  }
  return table;
}

Table EstimationSummary(const std::vector<EstimationRow>& rows) {
  const bool has_digits = HasDigits(rows);
  std::map<std::string, double> least_cost;
  for (const EstimationRow& row : rows) {
    if (!std::isfinite(row.final_cost)) continue;
    const auto [it, is_new] = least_cost.emplace(row.start, row.final_cost);
    if (!is_new) it->second = std::min(it->second, row.final_cost);
  }
  std::vector<std::string> methods;  // in the order of their first runs
  std::map<std::string, Sums> sums;
  for (const EstimationRow& row : rows) {
    if (sums.count(row.method) == 0) methods.push_back(row.method);
    sums[row.method].Add(row, least_cost[row.start]);
  }
  std::vector<Table::Column> columns = {
      {"method", Table::Align::kLeft}, {"starts"}, {"least cost"}};
  if (has_digits) {
    columns.insert(columns.end(), {{"solved"}, {"digits"}, {"mean digits"}});
  }
  columns.insert(columns.end(),
                 {{"iterations"}, {"accepted"}, {"rejected"}, {"s"}});
  Table table(columns);
  for (const std::string& method : methods) {
    const Sums& sum = sums[method];
    const std::string of = " of " + std::to_string(sum.num_runs);
    std::vector<std::string> cells = {method,
                                      std::to_string(sum.num_runs),
                                      std::to_string(sum.num_least) + of};
    if (has_digits) {
      const double solved = sum.num_solved;
      cells.push_back(std::to_string(sum.num_solved) + of);
      cells.push_back(solved > 0 ? Digits(sum.worst_digits / solved) : "-");
      cells.push_back(solved > 0 ? Digits(sum.mean_digits / solved) : "-");
    }
    cells.push_back(std::to_string(sum.num_iterations));
    cells.push_back(std::to_string(sum.num_accepted));
    cells.push_back(std::to_string(sum.num_rejected));
    cells.push_back(FormatNumber(sum.seconds, 3));
    table.AddRow(std::move(cells));
  }
  return table;
}

std::string EstimationCsv(const std::vector<EstimationRow>& rows) {
  std::ostringstream csv;
  csv.precision(std::numeric_limits<double>::max_digits10);
  csv << "start,method,initial_cost,final_cost,iterations,accepted,rejected,"
         "seconds,digits,mean_digits,status\n";
  for (const EstimationRow& row : rows) {
    csv << CsvField(row.start) << ',' << CsvField(row.method) << ','
        << row.initial_cost << ',' << row.final_cost << ','
        << row.num_iterations << ',' << row.num_accepted << ','
        << row.num_rejected << ',' << row.seconds << ',';
    if (row.digits.has_value()) {
      csv << row.digits->minCoeff() << ',' << row.digits->mean();
    } else {
      csv << ',';
    }
    csv << ',' << CsvField(row.status) << '\n';
  }
  return csv.str();
}

}  // namespace invgrad
