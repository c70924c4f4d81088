#include "bin/support/listing.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "fmt/core.h"
#include "invgrad/compare/compare.h"
#include "invgrad/methods/ceres_methods.h"
#include "invgrad/methods/pull_back_method.h"
#include "invgrad/rules.h"
#include "report/table.h"

namespace invgrad {

namespace {

using OptionRows = std::vector<OptionSet::Row>;

// What the tables of problems and methods have in common.
struct ListingEntry {
  std::string name;
  std::string about;
  OptionRows options;
};

// The rows of a table of rules, minimizers of Ceres, or pull-backs.
template <typename Rows>
std::vector<ListingEntry> MethodEntries(const Rows& rows) {
  std::vector<ListingEntry> entries;
  entries.reserve(rows.size());
  for (const auto& row : rows) {
    entries.push_back({row.name, row.formula, row.options()});
  }
  return entries;
}

std::string ListingText(const std::vector<ListingEntry>& entries) {
  std::string text;
  for (const ListingEntry& entry : entries) {
    text += fmt::format("  {}\n    {}\n", entry.name, entry.about);
    for (const OptionSet::Row& option : entry.options) {
      text += fmt::format("      {:<28} {}; {}\n",
                          option.name + "=" + option.default_value,
                          option.help,
                          option.allowed);
    }
  }
  return text;
}

std::string OptionTable(const OptionRows& options) {
  std::string text =
      "| option | default | allowed | meaning |\n|---|---|---|---|\n";
  for (const OptionSet::Row& option : options) {
    text += fmt::format("| `{}` | {} | {} | {} |\n",
                        option.name,
                        MarkdownCell(option.default_value),
                        MarkdownCell(option.allowed),
                        MarkdownCell(option.help));
  }
  return text + "\n";
}

// The options that at least three entries have with the same meaning, with the
// default and the range of the first of them.
OptionRows CommonOptions(const std::vector<ListingEntry>& entries) {
  std::map<std::pair<std::string, std::string>, OptionRows> same;
  OptionRows common;
  for (const ListingEntry& entry : entries) {
    for (const OptionSet::Row& option : entry.options) {
      OptionRows& options = same[{option.name, option.help}];
      options.push_back(option);
      if (options.size() == 3) common.push_back(options.front());
    }
  }
  return common;
}

std::string ListingMarkdown(const ListingEntry& entry,
                            const OptionRows& common) {
  std::string names;
  OptionRows own;
  for (const OptionSet::Row& option : entry.options) {
    const auto shared = std::find_if(
        common.begin(), common.end(), [&option](const OptionSet::Row& row) {
          return row.name == option.name && row.help == option.help;
        });
    if (shared == common.end()) {
      own.push_back(option);
      continue;
    }
    names += names.empty() ? "`" : ", `";
    names += option.name;
    if (option.default_value != shared->default_value) {
      names += "=" + option.default_value;
    }
    names += "`";
    if (option.allowed != shared->allowed) names += " (" + option.allowed + ")";
  }
  std::string text =
      fmt::format("## {}\n\n    {}\n\n", entry.name, entry.about);
  if (entry.options.empty()) text += "No options.\n\n";
  if (!names.empty()) text += "Common options: " + names + ".\n\n";
  return own.empty() ? text : text + OptionTable(own);
}

// The common options of all entries, and the parts of a page: titles and
// entries.
std::string ListingMarkdown(
    const std::vector<std::pair<std::string, std::vector<ListingEntry>>>&
        parts) {
  std::vector<ListingEntry> all;
  for (const auto& [title, entries] : parts) {
    all.insert(all.end(), entries.begin(), entries.end());
  }
  const OptionRows common = CommonOptions(all);
  std::string text =
      "## Common options\n\nEach section below names those that it has. A "
      "default or a range that differs from this table stands beside the "
      "name.\n\n" +
      OptionTable(common);
  for (const auto& [title, entries] : parts) {
    text += title;
    for (const ListingEntry& entry : entries)
      text += ListingMarkdown(entry, common);
  }
  return text;
}

// How the samples of a problem with its own settings are simulated; empty for a
// point problem, and for one that this build cannot make.
std::string SamplesText(const std::string& problem) {
  PhysicsProblem made;
  std::string error;
  if (!CreateProblem(problem, nullptr, &made, &error) ||
      !made.learning.has_value()) {
    return "";
  }
  const std::string why_no_lanes =
      made.learning->model->simulator().WhyNoLanes();
  return why_no_lanes.empty()
             ? " Samples: four at once."
             : fmt::format(" Samples: one at a time ({}).", why_no_lanes);
}

// The problems, or the least-squares problems alone.
std::vector<ListingEntry> ProblemEntries(bool least_squares_only) {
  std::vector<ListingEntry> entries;
  for (const ProblemRow& row : Problems()) {
    if (least_squares_only && !row.is_least_squares) continue;
    entries.push_back(
        {row.name, row.equation + "  [" + row.source + "]", row.options()});
  }
  return entries;
}

}  // namespace

std::string Listing() {
  return "Problems (--problem=name:key=value:...)\n" +
         ListingText(ProblemEntries(false)) +
         "\nRules (--rules=name:key=value:...,...); batch_size is an option of "
         "every rule\n" +
         ListingText(MethodEntries(Rules())) +
         "\nMethods that pull a wanted change back, part by part: "
         "LOSS/SIMULATOR/RULE with\n  LOSS gradient, newton, "
         "saddle_free_newton; SIMULATOR joint, adjoint, inverse_gradient,\n  "
         "half_inverse, inverse, numerical, newton, gradient_descent, lbfgs, "
         "data; RULE any rule.\n  By name:\n" +
         ListingText(MethodEntries(ChainMethods())) +
         "\nPhases, one after the other: adam:epochs=5>half_inverse. Each but "
         "the last has\n  epochs= or steps=, its share of the run\n"
         "\nRULE:output_layer=exact, in front of any physics: the network's "
         "last layer is solved by least\n  squares, and the rule trains the "
         "others; output_layer_period=N: every N steps; output_layer=auto: "
         "while that pays\n"
         "\nMinimizers of Ceres, on all samples at once; ceres_lm+RULE and "
         "ceres_dogleg+RULE let a rule propose steps,\n"
         "ceres_lm+LOSS/SIMULATOR/RULE and ceres_lm+sip a pull-back\n" +
         ListingText(MethodEntries(CeresMethods()));
}

std::string EstimateListing() {
  return "Problems (--problems=name:key=value:...,...)\n" +
         ListingText(ProblemEntries(true)) +
         "\nRules (--methods=name:key=value:...,...)\n" +
         ListingText(MethodEntries(Rules())) +
         "\nMinimizers of Ceres; ceres_lm+RULE and ceres_dogleg+RULE let a "
         "rule propose steps.\nlinear_solver is the input's own where nothing "
         "is said\n" +
         ListingText(MethodEntries(CeresMethods()));
}

std::string RulesMarkdown() {
  return "# Update rules\n\nGenerated by `compare --list_markdown=rules`. "
         "Symbols: [conventions.md](conventions.md). How rules combine: "
         "[methods.md](methods.md).\n\n" +
         ListingMarkdown(
             {{"", MethodEntries(Rules())},
              {"# Pull-backs through the chain\n\n",
               MethodEntries(ChainMethods())},
              {"# Minimizers of Ceres\n\n", MethodEntries(CeresMethods())}});
}

std::string ProblemsMarkdown() {
  std::vector<ListingEntry> entries;
  entries.reserve(Problems().size());
  for (const ProblemRow& row : Problems()) {
    entries.push_back({row.name,
                       row.equation + "\n\nSource: " + row.source + "." +
                           SamplesText(row.name),
                       row.options()});
  }
  return "# Problems\n\nGenerated by `compare --list_markdown=problems`.\n\n"
         "Problems with a network have a network of their own; `--hidden`, "
         "`--activation` and `--initialization` of `compare` and `sweep` give "
         "them another one. Samples are simulated four at once (in the lanes "
         "of the processor) where the simulator is a functor on any scalar. "
         "Details are in the headers of `problems/`.\n\n" +
         ListingMarkdown({{"", entries}});
}

}  // namespace invgrad
