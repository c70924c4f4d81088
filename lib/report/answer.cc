#include "report/answer.h"

#include <algorithm>
#include <cmath>

#include "fmt/core.h"
#include "invgrad/io/format.h"

namespace invgrad {
namespace {

// "3.1 times lower than adam"; without a factor of what is not positive.
std::string LowerThan(double best, const Score& other) {
  if (other.median == best) return "as low as " + other.name;
  const double factor = other.median / best;
  if (!(best > 0.0)) return "lower than " + other.name;
  if (factor < 1.005) return "as low as " + other.name;
  return fmt::format(
      "{} times lower than {}", FormatNumber(factor, 2), other.name);
}

std::string Ranges(const Score& best, const Score& next) {
  if (best.num_seeds == 0) return "";
  if (best.num_seeds == 1) return " One seed: another may change the order.";
  const auto highest = [](const Score& score) {
    return std::isinf(score.high) ? "failed" : FormatNumber(score.high, 3);
  };
  return fmt::format(" Over {} seeds their ranges {}: {} to {} and {} to {}.",
                     best.num_seeds,
                     best.high < next.low ? "do not overlap" : "overlap",
                     FormatNumber(best.low, 3),
                     highest(best),
                     FormatNumber(next.low, 3),
                     highest(next));
}

}  // namespace

std::string AnswerByCounts(
    const std::string& verb,
    const std::string& at,
    const std::string& places,
    const std::vector<std::pair<std::string, int>>& counts,
    int num_places) {
  std::vector<std::pair<std::string, int>> order = counts;
  std::stable_sort(
      order.begin(), order.end(), [](const auto& a, const auto& b) {
        return a.second > b.second;
      });
  std::string text;
  for (const auto& [name, count] : order) {
    if (count == 0) break;
    text += text.empty() ? fmt::format("{} {} {} {} of {} {}",
                                       name,
                                       verb,
                                       at,
                                       count,
                                       num_places,
                                       places)
                         : fmt::format(", {} {} {}", name, at, count);
  }
  return text.empty() ? text : text + ".";
}

std::string JoinNames(const std::vector<std::string>& names) {
  std::string text;
  for (size_t i = 0; i < names.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  }
  return text;
}

std::string AnswerByScores(const std::string& value,
                           const std::vector<Score>& scores) {
  if (scores.empty()) return "";
  std::vector<Score> order;
  std::vector<std::string> failed;
  for (const Score& score : scores) {
    if (std::isfinite(score.median)) {
      order.push_back(score);
    } else {
      failed.push_back(score.name);
    }
  }
  const std::string failures =
      failed.empty() ? "" : fmt::format(" No result of {}.", JoinNames(failed));
  if (order.empty()) return "No method has a result." + failures;
  std::stable_sort(
      order.begin(), order.end(), [](const Score& a, const Score& b) {
        return a.median < b.median;
      });
  const Score& best = order[0];
  std::string text = fmt::format("{} has the lowest {}{}, {}",
                                 best.name,
                                 best.num_seeds > 1 ? "median " : "",
                                 value,
                                 FormatNumber(best.median, 3));
  if (order.size() == 1) return text + "." + failures;
  text += fmt::format(": {}, the next ({})",
                      LowerThan(best.median, order[1]),
                      FormatNumber(order[1].median, 3));
  const auto first_order =
      std::find_if(order.begin() + 1, order.end(), [](const Score& score) {
        return score.is_first_order;
      });
  if (best.is_first_order) {
    text += "; it is a first-order method";
  } else if (first_order == order.begin() + 1) {
    text += " and the best first-order method";
  } else if (first_order != order.end()) {
    text += fmt::format(", and {}, the best first-order method ({})",
                        LowerThan(best.median, *first_order),
                        FormatNumber(first_order->median, 3));
  }
  return text + "." + Ranges(best, order[1]) + failures;
}

}  // namespace invgrad
