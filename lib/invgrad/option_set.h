// Names, ranges and help of the fields of an Options struct, in one place. Use
// it for the settings of a rule of your own (rules.h): they then appear on
// command lines and in listings.
//
//   struct Options {
//     double decay = 0.9;
//     void Describe(OptionSet* set) {
//       set->Add("decay", &decay, {0.0, 1.0}, "memory");
//     }
//   };
//
// The default of an option is the value of its field when it is added. The set
// generates command lines, listings and documentation. Numbers have C syntax,
// independently of the locale, and must be finite; the whole text must be the
// number.
//
// Fails:   Set and SetAll return false with a message that names the option,
//          the value, and what is allowed (the nearest names for an unknown
//          option): "step_size=-1 is out of range; allowed: (0, inf) or auto".
//          The field is then unchanged. CHECKs that no name is added twice and
//          that defaults are allowed.
#ifndef INVGRAD_OPTION_SET_H_
#define INVGRAD_OPTION_SET_H_

#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace invgrad {

// Names and values, as in "step_size=auto:rho=1".
using Settings = std::vector<std::pair<std::string, std::string>>;

// A name and settings, separated by colons: "half_inverse:step_size=auto:rho=1".
struct Specification {
  std::string text;  // as it was written
  std::string name;
  Settings settings;
};

// Splits "a:x=1:y=2,b" at commas. Space around the pieces is ignored. Returns
// false, with *error, for an empty name, a setting without '=', or an empty
// key.
bool ParseSpecifications(const std::string& text,
                         std::vector<Specification>* specifications,
                         std::string* error);

// The interval of allowed values; `open_low` and `open_high` exclude its ends.
// Infinity and NaN are never allowed.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool open_low = false;
  bool open_high = false;
};

class OptionSet {
 public:
  // The fields must outlive the set.
  void Add(const std::string& name,
           double* field,
           const Range& range,
           const std::string& help);
  // A number in the range, or "auto": no value.
  void Add(const std::string& name,
           std::optional<double>* field,
           const Range& range,
           const std::string& help);
  void Add(const std::string& name,
           int* field,
           const Range& range,
           const std::string& help);
  void Add(const std::string& name, bool* field, const std::string& help);
  // One of `choices`.
  void Add(const std::string& name,
           std::string* field,
           const std::vector<std::string>& choices,
           const std::string& help);

  bool Set(const std::string& name,
           const std::string& value,
           std::string* error);
  // Returns false for an option that occurs twice.
  bool SetAll(const Settings& settings, std::string* error);

  struct Row {
    std::string name;
    std::string default_value;
    // "(0, 1]", "(0, inf) or auto", "integer in [1, inf)",
    // "one of tanh, relu", "true or false"
    std::string allowed;
    std::string help;
  };
  const std::vector<Row>& rows() const { return rows_; }

 private:
  // Null if the value is allowed; otherwise the reason: "is out of range".
  using Setter = std::function<const char*(const std::string& value)>;
  void AddRow(Row row, Setter setter);

  std::vector<Row> rows_;
  std::vector<Setter> setters_;
};

}  // namespace invgrad

#endif  // INVGRAD_OPTION_SET_H_
