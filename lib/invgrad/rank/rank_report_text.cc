#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "fmt/core.h"
#include "fmt/ranges.h"
#include "invgrad/io/format.h"
#include "invgrad/rank_report.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// ceres::Covariance with DENSE_SVD fails below this value, the root of its
// default min_reciprocal_condition_number.
constexpr double kCovarianceLimit = 1e-7;

template <typename Number>
std::string Count(Number number, const std::string& what) {
  return fmt::format("{} {}{}", number, what, number == 1 ? "" : "s");
}

// Smaller ones are rounding errors.
std::string SingularValue(double s) {
  constexpr double kResolved = 1e-12;
  return s < kResolved ? "0" : FormatNumber(s, 2);
}

class Text {
 public:
  Text(const RankReport& report, int max_items)
      : report_(report),
        max_items_(static_cast<std::size_t>(std::max(1, max_items))) {}

  std::string Write() {
    Headline();
    Spectrum();
    Unused();
    Undetermined();
    Weak();
    EqualParameters();
    ShortColumns();
    WhatToDo();
    return text_;
  }

 private:
  template <typename... Args>
  void Add(fmt::format_string<Args...> format, Args&&... args) {
    text_ += fmt::format(format, std::forward<Args>(args)...);
  }

  // "a, b, c and 7 more"
  template <typename NameOf>
  std::string List(std::size_t size, const NameOf& name_of) const {
    std::string text;
    for (std::size_t i = 0; i < std::min(size, max_items_); ++i) {
      text += (i == 0 ? "" : ", ") + name_of(i);
    }
    if (size > max_items_) {
      text += fmt::format(" and {} more", size - max_items_);
    }
    return text;
  }

  template <typename LineOf>
  void AddLines(std::size_t size, const LineOf& line_of) {
    for (std::size_t i = 0; i < std::min(size, max_items_); ++i) {
      text_ += line_of(i) + "\n";
    }
    if (size > max_items_) Add("  ... and {} more\n", size - max_items_);
  }

  void Headline() {
    Add("rank {} of {} ({}, {} more held constant; {})\n",
        report_.rank,
        Count(report_.num_parameters, "parameter"),
        Count(report_.blocks.size(), "block"),
        report_.num_constant_blocks,
        Count(report_.num_residuals, "residual"));
    if (!report_.is_complete) {
      text_ +=
          "  at most: more directions may be undetermined than were "
          "found (raise max_directions or max_dense_size)\n";
    }
    if (report_.num_groups > 1) {
      Add("  in {} groups of blocks that no residual ties together\n",
          report_.num_groups);
    }
  }

  void Spectrum() {
    const VectorXd& s = report_.singular_values;
    if (s.size() == 0) return;
    Add("  smallest singular values of J, columns scaled to length one, "
        "relative to\n  the largest: {}\n  undetermined: up to {}; weak: up to "
        "{}\n",
        List(static_cast<std::size_t>(s.size()),
             [&s](std::size_t i) {
               return SingularValue(s[static_cast<Index>(i)]);
             }),
        FormatNumber(report_.threshold, 2),
        FormatNumber(report_.weak_threshold, 2));
    const VectorXd& unscaled = report_.unscaled_singular_values;
    if (unscaled.size() > 0) {
      Add("  the smallest of J as it is: {} (ceres::Covariance by DENSE_SVD: "
          "{})\n",
          SingularValue(unscaled[0]),
          unscaled[0] <= kCovarianceLimit ? "rank deficient" : "full rank");
    }
    // Of other blocks, whose units differ.
    constexpr double kNoise = 1e-14;
    if (report_.shortest_column < kNoise * report_.longest_column) {
      Add("  columns of J have lengths from {} to {}: the shortest may be "
          "rounding errors\n",
          FormatNumber(report_.shortest_column, 2),
          FormatNumber(report_.longest_column, 2));
    }
  }

  // "`a`" or "`a`[0], `a`[2]".
  template <typename Parameters>
  std::string Names(const Parameters& parameters) const {
    if (parameters.whole_block) {
      return fmt::format("`{}`", report_.blocks[parameters.block].name);
    }
    return List(parameters.tangent.size(), [&](std::size_t i) {
      return report_.blocks[parameters.block].ParameterName(
          parameters.tangent[i]);
    });
  }

  void Unused() {
    if (report_.unused.empty()) return;
    text_ += "\nnot seen by any residual:\n";
    AddLines(report_.unused.size(), [this](std::size_t i) {
      const RankReport::Unused& unused = report_.unused[i];
      return fmt::format(
          "  {}  {}",
          Names(unused),
          unused.in_no_residual ? "no residual block names it"
          : unused.has_rounding
              ? "named by residual blocks, but their derivatives are rounding "
                "errors"
              : "named by residual blocks, but their derivatives are 0");
    });
  }

  // " +1 `a`[0] -0.5 `b`[2]"
  std::string Motion(const RankReport::Direction& direction) const {
    std::vector<std::string> terms;
    for (const RankReport::Part& part : direction.parts) {
      for (Index i = 0; i < part.motion.size(); ++i) {
        constexpr double kZero = 1e-9;  // beside the largest, 1
        if (std::abs(part.motion[i]) < kZero) continue;
        terms.push_back(fmt::format(
            " {}{} {}",
            part.motion[i] > 0.0 ? "+" : "",
            FormatNumber(part.motion[i], 3),
            report_.blocks[part.block].ParameterName(static_cast<int>(i))));
      }
    }
    const bool is_cut = terms.size() > max_items_;
    if (is_cut) terms.resize(max_items_);
    std::string text = fmt::format("{}", fmt::join(terms, ""));
    if (is_cut) text += " ... (" + Count(direction.parts.size(), "block") + ")";
    return text;
  }

  void Undetermined() {
    if (report_.undetermined.empty()) return;
    text_ += "\nundetermined, motions that leave all residuals as they are:\n";
    for (const RankReport::GaugeFreedom& gauge : report_.gauges) Gauge(gauge);
    std::vector<const RankReport::Direction*> others;
    for (const RankReport::Direction& direction : report_.undetermined) {
      if (direction.gauge.empty()) others.push_back(&direction);
    }
    AddLines(others.size(),
             [&](std::size_t i) { return " " + Motion(*others[i]); });
  }

  void Gauge(const RankReport::GaugeFreedom& gauge) {
    const auto& first = report_.undetermined[gauge.directions.front()];
    Add("  gauge freedom: {} ({} of {}; {})\n",
        gauge.name,
        gauge.directions.size(),
        Count(gauge.num_generators, "direction"),
        Count(first.parts.size(), "block"));
    for (const int d : gauge.directions) {
      const RankReport::Direction& direction = report_.undetermined[d];
      text_ += direction.generator.empty()
                   ? "    a combination:" + Motion(direction) + "\n"
                   : "    " + direction.generator + "\n";
    }
  }

  void Weak() {
    if (report_.weak.empty()) return;
    text_ +=
        "\nweakly determined (s / s_max; errors of the residuals come out "
        "s_max / s larger):\n";
    AddLines(report_.weak.size(), [this](std::size_t i) {
      const RankReport::Direction& direction = report_.weak[i];
      return fmt::format(
          "  {}: {}{}",
          FormatNumber(direction.singular_value, 2),
          direction.gauge.empty() ? "" : "part of " + direction.gauge + ":",
          Motion(direction));
    });
  }

  void EqualParameters() {
    if (report_.equal_parameters.empty()) return;
    text_ +=
        "\nequal values with parallel columns of J; two parameters of a kind, "
        "such as the rates\nof two decays, need different start values, "
        "because J loses rank where they coincide:\n";
    AddLines(report_.equal_parameters.size(), [this](std::size_t i) {
      const RankReport::EqualParameters& equal = report_.equal_parameters[i];
      const auto name = [&](int k) {
        return report_.blocks[equal.blocks[k]].ParameterName(equal.tangents[k]);
      };
      return fmt::format(
          "  {} and {} = {}", name(0), name(1), FormatNumber(equal.value, 3));
    });
  }

  void ShortColumns() {
    if (report_.short_columns.empty()) return;
    text_ +=
        "\nshort columns; if the parameters of the block have one unit, they "
        "are weakly\ndetermined (Options::group_sizes gives them one scale):\n";
    AddLines(report_.short_columns.size(), [this](std::size_t i) {
      const RankReport::ShortColumn& column = report_.short_columns[i];
      return fmt::format(
          "  {}: {} of the others",
          report_.blocks[column.block].ParameterName(column.tangent),
          FormatNumber(column.relative_length, 2));
    });
  }

  void WhatToDo() {
    if (report_.unused.empty() && report_.suggestions.empty()) return;
    text_ +=
        "\nwhat to do, each line (hold constant, or add a prior, or remove):\n";
    AddLines(report_.unused.size(), [this](std::size_t i) {
      return fmt::format("  hold {} constant, or give it a residual",
                         Names(report_.unused[i]));
    });
    AddLines(report_.suggestions.size(), [this](std::size_t i) {
      const RankReport::Suggestion& suggestion = report_.suggestions[i];
      return fmt::format("  hold {} constant: takes away {} of {}",
                         Names(suggestion),
                         suggestion.num_removed,
                         std::count_if(report_.undetermined.begin(),
                                       report_.undetermined.end(),
                                       [&](const auto& direction) {
                                         return direction.group ==
                                                suggestion.group;
                                       }));
    });
  }

  const RankReport& report_;
  const std::size_t max_items_;
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

std::string RankReport::Block::ParameterName(int tangent) const {
  const int component = components[tangent];
  if (component < 0) return fmt::format("`{}` tangent {}", name, tangent);
  if (size == 1) return fmt::format("`{}`", name);
  return fmt::format("`{}`[{}]", name, component);
}

std::string RankReport::ToText(int max_items) const {
  return Text(*this, max_items).Write();
}

}  // namespace invgrad
