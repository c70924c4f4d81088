#include "bin/estimate/estimation_table.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "fmt/core.h"
#include "invgrad/io/format.h"

namespace invgrad {
namespace {

constexpr auto kLeft = Table::Align::kLeft;

bool HasDigits(const std::vector<EstimationRow>& rows) {
  return std::any_of(rows.begin(), rows.end(), [](const EstimationRow& row) {
    return row.digits.has_value();
  });
}

bool HasSolutions(const std::vector<EstimationRow>& rows) {
  return std::any_of(rows.begin(), rows.end(), [](const EstimationRow& row) {
    return row.is_solved.has_value();
  });
}

// Counts of a run or of sums of runs.
void AddCounts(const EstimationRow& counts, Table* table) {
  table->Add("iterations", std::to_string(counts.num_iterations));
  table->Add("accepted", std::to_string(counts.num_accepted));
  table->Add("rejected", std::to_string(counts.num_rejected));
}

// The fewest of a run.
std::string DeviationDigits(const EstimationRow& row, bool is_exact) {
  if (!row.deviation_digits) return is_exact ? "" : "-";
  const double digits = row.deviation_digits->minCoeff();
  return is_exact ? ExactNumber(digits) : FormatNumber(digits, 3);
}

std::vector<std::string> MethodsOf(const std::vector<EstimationRow>& rows) {
  std::vector<std::string> methods;  // in the order of their first runs
  for (const EstimationRow& row : rows) {
    if (std::count(methods.begin(), methods.end(), row.method) == 0) {
      methods.push_back(row.method);
    }
  }
  return methods;
}

// Of each input's costs. A bad start does not raise it; 0 if nothing is known.
std::map<std::string, double> CostScales(
    const std::vector<EstimationRow>& rows) {
  std::map<std::string, double> scales;
  for (const EstimationRow& row : rows) {
    double& scale = scales[row.input];
    for (const double cost : {row.initial_cost, row.constant_cost}) {
      if (!std::isfinite(cost) || cost <= 0.0) continue;
      scale = scale > 0.0 ? std::min(scale, cost) : cost;
    }
  }
  return scales;
}

// The highest cost that counts as the cost `low`, which two runs reach with
// different rounding errors. `zero`: the highest cost that counts as 0.
double HighestSameCost(double low, double share, double zero) {
  return low + share * std::abs(low) + zero;
}

}  // namespace

bool IsSolved(const EstimationRow& row) {
  return row.is_solved.value_or(false);
}

std::vector<std::pair<std::string, int>> LeastCostCounts(
    const std::vector<EstimationRow>& rows) {
  constexpr double kSameCost = 1e-6;
  constexpr double kZero = 1e-16;
  std::map<std::string, double> scales = CostScales(rows);
  std::map<std::string, double> least_cost;
  for (const EstimationRow& row : rows) {
    if (!std::isfinite(row.final_cost)) continue;
    const auto [it, is_new] = least_cost.emplace(row.start, row.final_cost);
    if (!is_new) it->second = std::min(it->second, row.final_cost);
  }
  std::vector<std::pair<std::string, int>> counts;
  for (const std::string& method : MethodsOf(rows)) {
    int count = 0;
    for (const EstimationRow& row : rows) {
      count += row.method == method && std::isfinite(row.final_cost) &&
               row.final_cost <= HighestSameCost(least_cost[row.start],
                                                 kSameCost,
                                                 kZero * scales[row.input]);
    }
    counts.emplace_back(method, count);
  }
  return counts;
}

Table LocalMinimaTable(const std::vector<EstimationRow>& rows) {
  constexpr double kSameCost = 1e-4;
  constexpr double kZero = 1e-12;
  constexpr size_t kMaxNumMinima = 10;
  std::map<std::string, double> scales = CostScales(rows);
  std::map<std::string, std::set<std::string>> starts;
  std::map<std::string, std::vector<double>> costs;
  for (const EstimationRow& row : rows) {
    starts[row.input].insert(row.start);
    if (std::isfinite(row.final_cost))
      costs[row.input].push_back(row.final_cost);
  }
  Table table;
  for (auto& input_and_ends : costs) {
    const std::string& input = input_and_ends.first;
    std::vector<double>& ends = input_and_ends.second;
    if (starts[input].size() < 2) continue;
    std::sort(ends.begin(), ends.end());
    const auto end_of = [zero = kZero * scales[input]](double low) {
      return HighestSameCost(low, kSameCost, zero);
    };
    const bool has_one = ends.back() <= end_of(ends[0]);
    if (has_one && costs.size() > 1) continue;
    size_t num_minima = 0;
    for (size_t i = 0; i < ends.size() && num_minima < kMaxNumMinima;) {
      const double low = ends[i], high = end_of(low);
      while (i < ends.size() && ends[i] <= high) ++i;
      table.BeginRow();
      table.Add("input", input, kLeft);
      table.Add("minimum", std::to_string(++num_minima));
      table.Add("cost", FormatNumber(low, 7));
      for (const std::string& method : MethodsOf(rows)) {
        table.Add(method,
                  std::to_string(std::count_if(
                      rows.begin(), rows.end(), [&](const EstimationRow& row) {
                        return row.input == input && row.method == method &&
                               row.final_cost >= low && row.final_cost <= high;
                      })));
      }
    }
  }
  return table;
}

Table EstimationTable(const std::vector<EstimationRow>& rows,
                      const std::vector<double>& levels,
                      bool is_exact) {
  const bool has_digits = HasDigits(rows);
  const bool has_solutions = HasSolutions(rows);
  const bool is_counted =
      std::any_of(rows.begin(), rows.end(), [](const EstimationRow& row) {
        return row.num_evaluations >= 0;
      });
  const bool has_covariances =
      std::any_of(rows.begin(), rows.end(), [](const EstimationRow& row) {
        return row.rank.has_value();
      });
  const auto number = [is_exact](double value, int digits) {
    return is_exact ? ExactNumber(value) : FormatNumber(value, digits);
  };
  const std::string none = is_exact ? "" : "-";
  Table table;
  for (const EstimationRow& row : rows) {
    table.BeginRow();
    table.Add("start", row.start, kLeft);
    table.Add("method", row.method, kLeft);
    table.Add(is_exact ? "initial_cost" : "initial cost",
              number(row.initial_cost, 7));
    table.Add(is_exact ? "final_cost" : "cost", number(row.final_cost, 7));
    AddCounts(row, &table);
    if (is_counted) {
      table.Add(
          "evaluations",
          row.num_evaluations < 0 ? none : std::to_string(row.num_evaluations));
      table.Add(is_exact ? "gradient_norm" : "|gradient|",
                number(row.gradient_norm, 3));
    }
    table.Add(is_exact ? "seconds" : "s", number(row.seconds, 3));
    for (size_t i = 0; i < levels.size(); ++i) {
      const double seconds =
          i < row.seconds_to.size() ? row.seconds_to[i] : std::nan("");
      const std::string level = FormatNumber(levels[i]);
      const bool is_never = is_exact && std::isnan(seconds);
      table.Add((is_exact ? "seconds_to_" : "s to ") + level,
                is_never   ? ""
                : is_exact ? ExactNumber(seconds)
                           : NumberOrDash(seconds));
    }
    if (has_digits || is_exact) {
      table.Add("digits",
                row.digits ? number(row.digits->minCoeff(), 3) : none);
      table.Add(is_exact ? "mean_digits" : "mean digits",
                row.digits ? number(row.digits->mean(), 3) : none);
    }
    if (has_solutions && !is_exact) {
      table.Add("solved", !row.is_solved ? "-" : IsSolved(row) ? "yes" : "no");
    }
    if (has_covariances && !is_exact) {
      table.Add("rank",
                row.rank
                    ? fmt::format("{} of {}", *row.rank, row.num_parameters)
                    : "-");
      if (has_digits) {
        table.Add("deviation digits", DeviationDigits(row, is_exact));
      }
    }
    table.Add("status", row.status, kLeft);
    if (is_exact) {
      table.Add("outside_domain", std::to_string(row.num_outside_domain));
      table.Add("rank", row.rank ? std::to_string(*row.rank) : "");
      table.Add("parameters",
                row.rank ? std::to_string(row.num_parameters) : "");
      table.Add("deviation_digits", DeviationDigits(row, is_exact));
    }
  }
  return table;
}

Table EstimationSummary(const std::vector<EstimationRow>& rows) {
  const bool has_digits = HasDigits(rows);
  Table table;
  for (const auto& [method, num_least] : LeastCostCounts(rows)) {
    EstimationRow sum;
    int num_runs = 0, num_known = 0, num_solved = 0, num_with_digits = 0;
    double worst_digits = 0.0, mean_digits = 0.0;  // sums of the solved runs
    for (const EstimationRow& row : rows) {
      if (row.method != method) continue;
      ++num_runs;
      if (row.is_solved) ++num_known;
      if (IsSolved(row)) ++num_solved;
      if (IsSolved(row) && row.digits) {
        ++num_with_digits;
        worst_digits += row.digits->minCoeff();
        mean_digits += row.digits->mean();
      }
      sum.num_iterations += row.num_iterations;
      sum.num_accepted += row.num_accepted;
      sum.num_rejected += row.num_rejected;
      sum.seconds += row.seconds;
    }
    const auto mean = [num = num_with_digits](double digits) {
      return num > 0 ? FormatNumber(digits / num, 3) : "-";
    };
    const auto share = [](int count, int of) {
      return fmt::format("{} of {}", count, of);
    };
    table.BeginRow();
    table.Add("method", method, kLeft);
    table.Add("starts", std::to_string(num_runs));
    table.Add("least cost", share(num_least, num_runs));
    if (HasSolutions(rows)) table.Add("solved", share(num_solved, num_known));
    if (has_digits) {
      table.Add("digits", mean(worst_digits));
      table.Add("mean digits", mean(mean_digits));
    }
    AddCounts(sum, &table);
    table.Add("s", FormatNumber(sum.seconds, 3));
  }
  return table;
}

}  // namespace invgrad
