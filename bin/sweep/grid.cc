#include "bin/sweep/grid.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "fmt/core.h"

namespace invgrad {
namespace {

// The pieces of text[begin, end) between the separators, without spaces around
// them.
std::vector<GridValue> Split(const std::string& text,
                             size_t begin,
                             size_t end,
                             char separator) {
  constexpr char kSpace[] = " \t\r\n";
  std::vector<GridValue> pieces;
  while (true) {
    const size_t stop = std::min(text.find(separator, begin), end);
    const size_t first = std::min(text.find_first_not_of(kSpace, begin), stop);
    std::string piece = text.substr(first, stop - first);
    piece.erase(piece.find_last_not_of(kSpace) + 1);
    pieces.push_back({piece, first});
    if (stop == end) return pieces;
    begin = stop + 1;
  }
}

std::vector<std::string> Split(const std::string& text, char separator) {
  std::vector<std::string> pieces;
  for (const GridValue& piece : Split(text, 0, text.size(), separator)) {
    pieces.push_back(piece.text);
  }
  return pieces;
}

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
  std::string mark;  // what stands before it: "", ">" or ":"
  std::string name;
  std::vector<std::string> values;  // of a setting; several: alternatives

  std::string Text(size_t k) const {
    return name + (values.empty() ? "" : "=" + values[k]);
  }
};

// Of "adam:epochs=5>half_inverse:truncation=1e-6|1e-3".
std::vector<Piece> Pieces(const std::string& method) {
  std::vector<Piece> pieces;
  for (const std::string& phase : Split(method, '>')) {
    std::string mark = pieces.empty() ? "" : ">";
    for (const std::string& part : Split(phase, ':')) {
      const size_t equals = part.find('=');
      Piece piece{mark, Split(part.substr(0, equals), '=')[0], {}};
      if (equals != std::string::npos) {
        piece.values = Split(part.substr(equals + 1), '|');
      }
      pieces.push_back(piece);
      mark = ":";
    }
  }
  return pieces;
}

}  // namespace

const GridAxis* Grid::Find(const std::string& name) const {
  for (const GridAxis& axis : axes) {
    if (axis.name == name) return &axis;
  }
  return nullptr;
}

bool ParseGrid(const std::string& text, Grid* grid, std::string* error) {
  *grid = {text, {}};
  const auto refuse = [&](size_t position, const std::string& message) {
    *error = GridMessage(text, position, message);
    return false;
  };
  for (const GridValue& part : Split(text, 0, text.size(), ';')) {
    const size_t equals = part.text.find('=');
    const std::string name = Split(part.text.substr(0, equals), '=')[0];
    if (equals == std::string::npos || name.empty()) {
      return refuse(part.position, "expected an axis, name=value,value");
    }
    if (grid->Find(name) != nullptr) {
      return refuse(part.position, "the axis '" + name + "' is given twice");
    }
    GridAxis axis{name, part.position, {}};
    for (const GridValue& value : Split(text,
                                        part.position + equals + 1,
                                        part.position + part.text.size(),
                                        ',')) {
      if (value.text.empty()) {
        return refuse(value.position, "expected a value of '" + name + "'");
      }
      if (name != "rule" && value.text.find('|') != std::string::npos) {
        return refuse(value.position,
                      "'|' is for alternatives of a rule's setting; expected "
                      "',' between values");
      }
      for (const GridValue& other : axis.values) {
        if (other.text == value.text && value.text != "...") {
          return refuse(
              value.position,
              fmt::format(
                  "the value '{}' of '{}' is given twice", value.text, name));
        }
      }
      axis.values.push_back(value);
    }
    grid->axes.push_back(axis);
  }
  return true;
}

std::string GridMessage(const std::string& text,
                        size_t position,
                        const std::string& message) {
  std::string line = text;
  for (char& c : line) {
    if (std::isspace(static_cast<unsigned char>(c)) != 0) c = ' ';
  }
  return fmt::format("--grid: column {}: {}\n  {}\n  {}^",
                     position + 1,
                     message,
                     line,
                     std::string(position, ' '));
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

std::string WithoutAlternatives(const std::string& rule) {
  std::string text;
  for (const Piece& piece : Pieces(rule)) {
    if (piece.values.size() < 2) text += piece.mark + piece.Text(0);
  }
  return text;
}

bool ParseFinite(const std::string& text, double* number) {
  const char* const end = text.data() + text.size();
  const std::from_chars_result result =
      std::from_chars(text.data(), end, *number);
  return result.ec == std::errc() && result.ptr == end &&
         std::isfinite(*number);
}

}  // namespace invgrad
