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

template <typename Field>
auto Count(Field field) {
  return [field](const auto& row) { return std::to_string(row.*field); };
}

// Of one method.
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
  std::vector<ColumnOf<Row>> columns = {
      {"start", [](const Row& row) { return row.start; }, kLeft},
      {"method", [](const Row& row) { return row.method; }, kLeft},
      {"initial cost",
       [](const Row& row) { return FormatNumber(row.initial_cost, 7); }},
      {"cost", [](const Row& row) { return FormatNumber(row.final_cost, 7); }},
      {"iterations", Count(&Row::num_iterations)},
      {"accepted", Count(&Row::num_accepted)},
      {"rejected", Count(&Row::num_rejected)},
      {"s", [](const Row& row) { return FormatNumber(row.seconds, 3); }}};
  if (HasDigits(rows)) {
    const auto if_known = [](auto cell) {
      return [cell](const Row& row) {
        return row.digits.has_value() ? cell(row) : "-";
      };
    };
    columns.push_back({"digits", if_known([](const Row& row) {
                         return FormatNumber(row.digits->minCoeff(), 3);
                       })});
    columns.push_back({"mean digits", if_known([](const Row& row) {
                         return FormatNumber(row.digits->mean(), 3);
                       })});
    columns.push_back({"solved", if_known([](const Row& row) {
                         return std::string(IsSolved(row) ? "yes" : "no");
                       })});
  }
  columns.push_back(
      {"status", [](const Row& row) { return row.status; }, kLeft});
  return MakeTable(columns, rows);
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
  const auto share = [](int Sums::*count) {
    return [count](const Sums& sums) {
      return fmt::format("{} of {}", sums.*count, sums.num_runs);
    };
  };
  const auto mean = [](double Sums::*digits) {
    return [digits](const Sums& sums) {
      return sums.num_solved > 0
                 ? FormatNumber(sums.*digits / sums.num_solved, 3)
                 : "-";
    };
  };
  std::vector<ColumnOf<Sums>> columns = {
      {"method", [](const Sums& sums) { return sums.method; }, kLeft},
      {"starts", Count(&Sums::num_runs)},
      {"least cost", share(&Sums::num_least)}};
  if (HasDigits(rows)) {
    columns.push_back({"solved", share(&Sums::num_solved)});
    columns.push_back({"digits", mean(&Sums::worst_digits)});
    columns.push_back({"mean digits", mean(&Sums::mean_digits)});
  }
  columns.push_back({"iterations", Count(&Sums::num_iterations)});
  columns.push_back({"accepted", Count(&Sums::num_accepted)});
  columns.push_back({"rejected", Count(&Sums::num_rejected)});
  columns.push_back(
      {"s", [](const Sums& sums) { return FormatNumber(sums.seconds, 3); }});
  return MakeTable(columns, all);
}

Table EstimationRuns(const std::vector<Row>& rows) {
  const auto exact = [](double Row::*field) {
    return [field](const Row& row) { return ExactNumber(row.*field); };
  };
  const auto digits = [](auto summary) {
    return [summary](const Row& row) {
      return row.digits.has_value() ? ExactNumber(summary(*row.digits)) : "";
    };
  };
  return MakeTable<Row>(
      {{"start", [](const Row& row) { return row.start; }},
       {"method", [](const Row& row) { return row.method; }},
       {"initial_cost", exact(&Row::initial_cost)},
       {"final_cost", exact(&Row::final_cost)},
       {"iterations", Count(&Row::num_iterations)},
       {"accepted", Count(&Row::num_accepted)},
       {"rejected", Count(&Row::num_rejected)},
       {"seconds", exact(&Row::seconds)},
       {"digits",
        digits([](const Eigen::VectorXd& all) { return all.minCoeff(); })},
       {"mean_digits",
        digits([](const Eigen::VectorXd& all) { return all.mean(); })},
       {"status", [](const Row& row) { return row.status; }}},
      rows);
}

}  // namespace invgrad
