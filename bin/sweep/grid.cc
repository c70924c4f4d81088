#include "bin/sweep/grid.h"

#include <algorithm>

#include "fmt/core.h"
#include "invgrad/core/specification.h"

namespace invgrad {
namespace {

// True if `choice` is the smallest or the largest of the numbers.
bool IsAtEdge(const std::vector<std::string>& values, size_t choice) {
  std::vector<double> numbers(values.size());
  for (size_t i = 0; i < values.size(); ++i) {
    if (!ParseFinite(values[i], &numbers[i])) return false;
  }
  const auto [low, high] = std::minmax_element(numbers.begin(), numbers.end());
  return *low < *high && (numbers[choice] == *low || numbers[choice] == *high);
}

// A part of a method: the name of a phase's rule, or a setting of it.
struct Piece {
  std::string mark;  // the separator before it: "", ">" or ":"
  std::string name;
  std::vector<std::string> values;  // of a setting; several: alternatives

  std::string Text(size_t k) const {
    return name + (values.empty() ? "" : "=" + values[k]);
  }
};

// The parts of "adam:epochs=5>half_inverse:truncation=1e-6|1e-3".
std::vector<Piece> Pieces(const std::string& method) {
  std::vector<Piece> pieces;
  for (const std::string& phase : TrimmedPieces(method, '>')) {
    std::string mark = pieces.empty() ? "" : ">";
    for (const std::string& part : TrimmedPieces(phase, ':')) {
      const size_t equals = part.find('=');
      Piece piece{mark, std::string(Trimmed(part.substr(0, equals))), {}};
      if (equals != std::string::npos) {
        piece.values = TrimmedPieces(part.substr(equals + 1), '|');
      }
      pieces.push_back(piece);
      mark = ":";
    }
  }
  return pieces;
}

}  // namespace

int Grid::Find(const std::string& name) const {
  for (size_t k = 0; k < axes.size(); ++k) {
    if (axes[k].name == name) return static_cast<int>(k);
  }
  return -1;
}

bool ParseGrid(const std::string& text, Grid* grid, std::string* error) {
  grid->axes.clear();
  const auto refuse = [error](const std::string& message) {
    *error = "--grid: " + message;
    return false;
  };
  for (const std::string& part : TrimmedPieces(text, ';')) {
    const size_t equals = part.find('=');
    GridAxis axis{std::string(Trimmed(part.substr(0, equals))), {}};
    if (equals == std::string::npos || axis.name.empty()) {
      return refuse("expected an axis, name=value,value, found '" + part + "'");
    }
    if (grid->Find(axis.name) >= 0) {
      return refuse("the axis '" + axis.name + "' is given twice");
    }
    for (const std::string& value :
         TrimmedPieces(part.substr(equals + 1), ',')) {
      if (value.empty()) {
        return refuse("the axis '" + axis.name + "' has an empty value");
      }
      if (axis.name != "rule" && value.find('|') != std::string::npos) {
        return refuse("'" + value +
                      "': '|' is for alternatives of a rule's setting; "
                      "expected ',' between values");
      }
      if (value != "..." &&
          std::count(axis.values.begin(), axis.values.end(), value) > 0) {
        return refuse(fmt::format(
            "the value '{}' of '{}' is given twice", value, axis.name));
      }
      axis.values.push_back(value);
    }
    grid->axes.push_back(axis);
  }
  return true;
}

std::vector<RuleAlternative> ExpandRule(const std::string& rule) {
  std::vector<RuleAlternative> all = {RuleAlternative()};
  for (const Piece& piece : Pieces(rule)) {
    std::vector<RuleAlternative> longer;
    for (const RuleAlternative& before : all) {
      for (size_t k = 0; k < std::max<size_t>(piece.values.size(), 1); ++k) {
        RuleAlternative alternative = before;
        alternative.specification += piece.mark + piece.Text(k);
        if (piece.values.size() > 1) {
          alternative.chosen += alternative.chosen.empty() ? "" : ":";
          alternative.chosen += piece.Text(k);
          if (IsAtEdge(piece.values, k)) {
            alternative.at_edge.push_back(piece.name);
          }
        }
        longer.push_back(alternative);
      }
    }
    all = longer;
  }
  return all;
}

}  // namespace invgrad
