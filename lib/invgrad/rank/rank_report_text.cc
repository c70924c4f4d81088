#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "invgrad/io/format.h"
#include "invgrad/rank/rank_report.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// What ceres::Covariance refuses with DENSE_SVD, whose default
// min_reciprocal_condition_number is the square.
constexpr double kCovarianceLimit = 1e-7;

std::string Count(int number, const std::string& what) {
  return std::to_string(number) + " " + what + (number == 1 ? "" : "s");
}

std::string Quoted(const std::string& name) { return "`" + name + "`"; }

// "a, b, c and 7 more", from at most max_items names of `size`.
template <typename NameOf>
std::string List(std::size_t size, int max_items, const NameOf& name_of) {
  const std::size_t shown =
      std::min(size, static_cast<std::size_t>(std::max(1, max_items)));
  std::string text;
  for (std::size_t i = 0; i < shown; ++i) {
    text += (i == 0 ? "" : ", ") + name_of(i);
  }
  if (size > shown) text += " and " + std::to_string(size - shown) + " more";
  return text;
}

class Text {
 public:
  Text(const RankReport& report, int max_items)
      : report_(report), max_items_(max_items) {}

  std::string Write() {
    Headline();
    Spectrum();
    Unused();
    Undetermined();
    Weak();
    WhatToDo();
    return text_;
  }

 private:
  void Headline() {
    text_ += "rank " + std::to_string(report_.rank) + " of " +
             Count(report_.num_parameters, "parameter") + " (" +
             Count(static_cast<int>(report_.blocks.size()), "block") + ", " +
             std::to_string(report_.num_constant_blocks) +
             " more held constant; " +
             Count(report_.num_residuals, "residual") + ")\n";
    if (!report_.is_complete) {
      text_ +=
          "  at most: more directions may be undetermined than were "
          "found (raise max_directions or max_dense_size)\n";
    }
    if (report_.num_groups > 1) {
      text_ += "  in " + std::to_string(report_.num_groups) +
               " groups of blocks that no residual ties together\n";
    }
  }

  // Digits of rounding errors say nothing.
  static std::string FormatSingularValue(double s) {
    constexpr double kResolved = 1e-12;
    return s < kResolved ? "0" : FormatNumber(s, 2);
  }

  static std::string FirstNumbers(const VectorXd& s, int max_items) {
    return List(
        static_cast<std::size_t>(s.size()), max_items, [&s](std::size_t i) {
          return FormatSingularValue(s[static_cast<Index>(i)]);
        });
  }

  void Spectrum() {
    const VectorXd& s = report_.singular_values;
    if (s.size() == 0) return;
    text_ +=
        "  smallest singular values of J, columns scaled to length one, "
        "relative to\n  the largest: " +
        FirstNumbers(s, max_items_) + "\n  undetermined: up to " +
        FormatNumber(report_.threshold, 2) + "; weak: up to " +
        FormatNumber(report_.weak_threshold, 2) + "\n";
    const VectorXd& unscaled = report_.unscaled_singular_values;
    if (unscaled.size() > 0) {
      text_ +=
          "  the smallest of J as it is: " + FormatSingularValue(unscaled[0]);
      const auto refused = (unscaled.array() <= kCovarianceLimit).count();
      text_ += refused > 0
                   ? " (ceres::Covariance by DENSE_SVD: rank deficient)\n"
                   : " (ceres::Covariance by DENSE_SVD: full rank)\n";
    }
    // Where scaled columns hide that a derivative is rounding noise.
    constexpr double kNoise = 1e-14;
    if (report_.shortest_column < kNoise * report_.longest_column) {
      text_ += "  columns of J have lengths from " +
               FormatNumber(report_.shortest_column, 2) + " to " +
               FormatNumber(report_.longest_column, 2) +
               ": the shortest may be rounding errors\n";
    }
  }

  // "`a`" or "`a`[0], `a`[2]".
  std::string Parameters(int block,
                         bool whole_block,
                         const std::vector<int>& tangent) const {
    if (whole_block) return Quoted(report_.blocks[block].name);
    return List(tangent.size(), max_items_, [&](std::size_t i) {
      return report_.ComponentName(block, tangent[i]);
    });
  }

  void Unused() {
    if (report_.unused.empty()) return;
    text_ += "\nnot seen by any residual:\n";
    AddLines(report_.unused.size(), [this](std::size_t i) {
      const RankReport::Unused& unused = report_.unused[i];
      return "  " +
             Parameters(unused.block, unused.whole_block, unused.tangent) +
             (unused.in_no_residual
                  ? "  no residual block names it"
                  : "  named by residual blocks, but their derivatives are 0");
    });
  }

  // At most max_items lines.
  template <typename LineOf>
  void AddLines(std::size_t size, const LineOf& line_of) {
    const std::size_t shown =
        std::min(size, static_cast<std::size_t>(std::max(1, max_items_)));
    for (std::size_t i = 0; i < shown; ++i) text_ += line_of(i) + "\n";
    if (size > shown) {
      text_ += "  ... and " + std::to_string(size - shown) + " more\n";
    }
  }

  // "+1 `a`[0] -0.5 `b`[2]"
  std::string Motion(const RankReport::Direction& direction) const {
    std::vector<std::string> terms;
    for (const RankReport::Part& part : direction.parts) {
      for (Index i = 0; i < part.motion.size(); ++i) {
        constexpr double kZero = 1e-9;  // beside the largest, 1
        if (std::abs(part.motion[i]) < kZero) continue;
        terms.push_back((part.motion[i] > 0.0 ? "+" : "") +
                        FormatNumber(part.motion[i], 3) + " " +
                        report_.ComponentName(part.block, static_cast<int>(i)));
      }
    }
    const std::size_t shown = std::min(
        terms.size(), static_cast<std::size_t>(std::max(1, max_items_)));
    std::string text;
    for (std::size_t i = 0; i < shown; ++i) text += " " + terms[i];
    if (terms.size() > shown) {
      text += " ... (" +
              Count(static_cast<int>(direction.parts.size()), "block") + ")";
    }
    return text;
  }

  void Undetermined() {
    if (report_.undetermined.empty()) return;
    text_ += "\nundetermined, motions that leave all residuals as they are:\n";
    std::vector<bool> is_told(report_.undetermined.size(), false);
    for (const RankReport::GaugeFreedom& gauge : report_.gauges) {
      Gauge(gauge);
      for (const int d : gauge.directions) is_told[d] = true;
    }
    std::vector<std::size_t> others;
    for (std::size_t d = 0; d < is_told.size(); ++d) {
      if (!is_told[d]) others.push_back(d);
    }
    AddLines(others.size(), [&](std::size_t i) {
      return " " + Motion(report_.undetermined[others[i]]);
    });
  }

  void Gauge(const RankReport::GaugeFreedom& gauge) {
    const auto count = static_cast<int>(gauge.directions.size());
    const RankReport::Direction& first =
        report_.undetermined[gauge.directions.front()];
    text_ += "  gauge freedom: " + gauge.name + " (" + std::to_string(count) +
             " of " + Count(gauge.num_generators, "direction") + "; " +
             Count(static_cast<int>(first.parts.size()), "block") + ")\n";
    for (const int d : gauge.directions) {
      const RankReport::Direction& direction = report_.undetermined[d];
      if (direction.generator.empty()) {
        text_ += "    a combination:" + Motion(direction) + "\n";
      } else {
        text_ += "    " + direction.generator + "\n";
      }
    }
  }

  void Weak() {
    if (report_.weak.empty()) return;
    text_ +=
        "\nweakly determined (s / s_max; errors of the residuals come out "
        "s_max / s larger):\n";
    AddLines(report_.weak.size(), [this](std::size_t i) {
      const RankReport::Direction& direction = report_.weak[i];
      return "  " + FormatNumber(direction.singular_value, 2) + ": " +
             (direction.gauge.empty() ? ""
                                      : "part of " + direction.gauge + ":") +
             Motion(direction);
    });
  }

  void WhatToDo() {
    if (report_.unused.empty() && report_.suggestions.empty()) return;
    text_ += "\nwhat to do (any one of: hold constant, add a prior, remove):\n";
    AddLines(report_.unused.size(), [this](std::size_t i) {
      const RankReport::Unused& unused = report_.unused[i];
      return "  hold " +
             Parameters(unused.block, unused.whole_block, unused.tangent) +
             " constant, or give it a residual";
    });
    AddLines(report_.suggestions.size(), [this](std::size_t i) {
      const RankReport::Suggestion& suggestion = report_.suggestions[i];
      return "  hold " +
             Parameters(
                 suggestion.block, suggestion.whole_block, suggestion.tangent) +
             " constant: takes away " + std::to_string(suggestion.num_removed) +
             " of " + std::to_string(NumOfGroup(suggestion.group));
    });
  }

  int NumOfGroup(int group) const {
    return static_cast<int>(
        std::count_if(report_.undetermined.begin(),
                      report_.undetermined.end(),
                      [group](const RankReport::Direction& direction) {
                        return direction.group == group;
                      }));
  }

  const RankReport& report_;
  const int max_items_;
  std::string text_;
};

}  // namespace

VectorXd RankReport::Step(const Direction& direction) const {
  VectorXd step = VectorXd::Zero(num_parameters);
  for (const Part& part : direction.parts) {
    step.segment(blocks[part.block].column, part.motion.size()) = part.motion;
  }
  return step;
}

std::string RankReport::ComponentName(int block, int tangent) const {
  const Block& b = blocks[block];
  const int component = b.components[tangent];
  if (component >= 0) {
    return b.size == 1 ? Quoted(b.name)
                       : Quoted(b.name) + "[" + std::to_string(component) + "]";
  }
  return Quoted(b.name) + " tangent " + std::to_string(tangent);
}

std::string RankReport::ToText(int max_items) const {
  return Text(*this, max_items).Write();
}

}  // namespace invgrad
