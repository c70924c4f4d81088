#include "bin/support/sweep_grid.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <limits>

namespace invgrad {

namespace {

constexpr char kSpace[] = " \t\r\n";

// A piece of the text, [begin, end).
struct Span {
  size_t begin = 0;
  size_t end = 0;

  bool is_empty() const { return begin >= end; }
};

Span Trimmed(const std::string& text, Span span) {
  const auto is_space = [&text](size_t i) {
    return std::string(kSpace).find(text[i]) != std::string::npos;
  };
  while (span.begin < span.end && is_space(span.begin)) ++span.begin;
  while (span.begin < span.end && is_space(span.end - 1)) --span.end;
  return span;
}

// The trimmed pieces between the separators.
std::vector<Span> Split(const std::string& text, Span span, char separator) {
  std::vector<Span> pieces;
  while (true) {
    const size_t found = text.find(separator, span.begin);
    const size_t end = std::min(found, span.end);
    pieces.push_back(Trimmed(text, {span.begin, end}));
    if (end == span.end) return pieces;
    span.begin = end + 1;
  }
}

std::vector<std::string> SplitText(const std::string& text, char separator) {
  std::vector<std::string> pieces;
  for (const Span& span : Split(text, {0, text.size()}, separator)) {
    pieces.push_back(text.substr(span.begin, span.end - span.begin));
  }
  return pieces;
}

class GridParser {
 public:
  GridParser(const std::string& text, Grid* grid, std::string* error)
      : text_(text), grid_(grid), error_(error) {}

  bool Parse() {
    grid_->text = text_;
    grid_->axes.clear();
    const std::vector<Span> axes = Split(text_, {0, text_.size()}, ';');
    return std::all_of(axes.begin(), axes.end(), [this](const Span& span) {
      return ParseAxis(span);
    });
  }

 private:
  bool ParseAxis(const Span& span) {
    if (span.is_empty()) {
      return Expected("an axis, name=value,value", span.begin);
    }
    GridAxis axis;
    axis.position = span.begin;
    size_t end = span.begin;
    while (end < span.end && IsNameCharacter(text_[end])) ++end;
    axis.name = text_.substr(span.begin, end - span.begin);
    if (axis.name.empty()) return Expected("the name of an axis", end);
    const Span rest = Trimmed(text_, {end, span.end});
    if (rest.is_empty() || text_[rest.begin] != '=') {
      return Expected("'=' after the name '" + axis.name + "'", rest.begin);
    }
    if (grid_->Find(axis.name) != nullptr) {
      return Refuse("the axis '" + axis.name + "' is given twice",
                    axis.position);
    }
    for (const Span& value : Split(text_, {rest.begin + 1, rest.end}, ',')) {
      if (!ParseValue(value, &axis)) return false;
    }
    grid_->axes.push_back(axis);
    return true;
  }

  bool ParseValue(const Span& span, GridAxis* axis) {
    if (span.is_empty()) {
      return Expected("a value of '" + axis->name + "'", span.begin);
    }
    if (!(axis->name == "rule" ? CheckRule(span) : CheckPlain(span))) {
      return false;
    }
    GridValue value;
    value.text = text_.substr(span.begin, span.end - span.begin);
    value.position = span.begin;
    for (const GridValue& other : axis->values) {
      if (other.text == value.text) {
        return Refuse("the value '" + value.text + "' of '" + axis->name +
                          "' is given twice",
                      span.begin);
      }
    }
    axis->values.push_back(value);
    return true;
  }

  // Where no alternatives may stand.
  bool CheckPlain(const Span& span) {
    const size_t bar = text_.find('|', span.begin);
    return bar >= span.end || Refuse(
                                  "'|' is for alternatives of a rule's "
                                  "setting; expected ',' between values",
                                  bar);
  }

  // phase>phase
  bool CheckRule(const Span& span) {
    const std::vector<Span> phases = Split(text_, span, '>');
    return std::all_of(phases.begin(), phases.end(), [this](const Span& phase) {
      return CheckPhase(phase);
    });
  }

  // name:key=value|value:key=value
  bool CheckPhase(const Span& span) {
    const std::vector<Span> pieces = Split(text_, span, ':');
    if (pieces[0].is_empty()) {
      return Expected("the name of a rule", pieces[0].begin);
    }
    if (!CheckPlain(pieces[0])) return false;
    for (size_t i = 1; i < pieces.size(); ++i) {
      const size_t equals = text_.find('=', pieces[i].begin);
      if (pieces[i].is_empty() || equals == pieces[i].begin) {
        return Expected("a setting, key=value", pieces[i].begin);
      }
      if (equals >= pieces[i].end) {
        return Expected("'=' after the setting's key", pieces[i].end);
      }
      for (const Span& value : Split(text_, {equals + 1, pieces[i].end}, '|')) {
        if (value.is_empty()) {
          return Expected("a value of the setting", value.begin);
        }
      }
    }
    return true;
  }

  static bool IsNameCharacter(char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
  }

  bool Expected(const std::string& what, size_t position) {
    position =
        std::min(text_.find_first_not_of(kSpace, position), text_.size());
    return Refuse("expected " + what + ", found " +
                      (position < text_.size()
                           ? "'" + std::string(1, text_[position]) + "'"
                           : std::string("the end")),
                  position);
  }

  bool Refuse(const std::string& message, size_t position) {
    *error_ = GridMessage(text_, position, message);
    return false;
  }

  const std::string& text_;
  Grid* grid_;
  std::string* error_;
};

// True if `choice` is the smallest or the largest of the numbers.
bool IsAtEdge(const std::vector<std::string>& values, size_t choice) {
  std::vector<double> numbers;
  for (const std::string& value : values) {
    double number = 0.0;
    if (!ParseFinite(value, &number)) return false;
    numbers.push_back(number);
  }
  const auto [low, high] = std::minmax_element(numbers.begin(), numbers.end());
  return *low < *high && (numbers[choice] == *low || numbers[choice] == *high);
}

// A part of a method: the name of a phase's rule, or a setting of it.
struct Piece {
  std::string mark;  // what stands before it: "", ">" or ":"
  std::string name;
  std::vector<std::string> values;  // of a setting; several: alternatives

  std::string text() const {
    return mark + name + (values.empty() ? "" : "=" + values[0]);
  }
};

// Of "adam:epochs=5>half_inverse:truncation=1e-6|1e-3".
std::vector<Piece> Pieces(const std::string& method) {
  std::vector<Piece> pieces;
  for (const std::string& phase : SplitText(method, '>')) {
    const std::vector<std::string> parts = SplitText(phase, ':');
    pieces.push_back({pieces.empty() ? "" : ">", parts[0], {}});
    for (size_t i = 1; i < parts.size(); ++i) {
      const size_t equals = parts[i].find('=');
      pieces.push_back({":",
                        SplitText(parts[i].substr(0, equals), '=')[0],
                        SplitText(parts[i].substr(equals + 1), '|')});
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
  return GridParser(text, grid, error).Parse();
}

std::string GridMessage(const std::string& text,
                        size_t position,
                        const std::string& message) {
  std::string line = text;
  for (char& c : line) {
    if (std::isspace(static_cast<unsigned char>(c)) != 0) c = ' ';
  }
  return "--grid: column " + std::to_string(position + 1) + ": " + message +
         "\n  " + line + "\n  " + std::string(position, ' ') + "^";
}

std::vector<RuleAlternative> ExpandRule(const std::string& rule) {
  std::vector<RuleAlternative> all = {RuleAlternative()};
  for (const Piece& piece : Pieces(rule)) {
    if (piece.values.empty()) {
      for (RuleAlternative& one : all) one.specification += piece.text();
      continue;
    }
    std::vector<RuleAlternative> longer;
    for (const RuleAlternative& before : all) {
      for (size_t k = 0; k < piece.values.size(); ++k) {
        RuleAlternative alternative = before;
        const std::string setting = piece.name + "=" + piece.values[k];
        alternative.specification += piece.mark + setting;
        if (piece.values.size() > 1) {
          alternative.chosen += (alternative.chosen.empty() ? "" : ":");
          alternative.chosen += setting;
        }
        if (IsAtEdge(piece.values, k)) {
          alternative.at_edge.push_back(piece.name);
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
    if (piece.values.size() < 2) text += piece.text();
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
