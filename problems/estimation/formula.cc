#include "problems/estimation/formula.h"

#include <cctype>
#include <charconv>
#include <deque>
#include <string_view>
#include <utility>

#include "fmt/core.h"
#include "invgrad/core/specification.h"
#include "invgrad/internal/logging.h"
#include "muParser.h"

namespace invgrad {
namespace {

using Op = Formula::Op;

// What muParser computes with in place of numbers: indices of operations.
struct Record {
  std::vector<std::string> variables;
  std::vector<Formula::Operation> operations;
  std::deque<double> places;  // of the variables, for muParser

  double Add(Formula::Operation operation) {
    operations.push_back(operation);
    return static_cast<double>(operations.size() - 1);
  }
};

// muParser's operators have no argument for it.
thread_local Record* current_record = nullptr;

template <Op kOp>
double RecordOne(double a) {
  const auto index = static_cast<int>(a);
  const Formula::Operation& of = current_record->operations[index];
  if (kOp == Op::kNegate && of.op == Op::kNumber) {
    return current_record->Add({Op::kNumber, 0, 0, 0, -of.number});
  }
  return current_record->Add({kOp, index, -1, -1, 0.0});
}

double RecordPlus(double a) { return a; }

template <Op kOp>
double RecordTwo(double a, double b) {
  return current_record->Add(
      {kOp, static_cast<int>(a), static_cast<int>(b), -1, 0.0});
}

double RecordIf(double a, double b, double c) {
  return current_record->Add({Op::kIf,
                              static_cast<int>(a),
                              static_cast<int>(b),
                              static_cast<int>(c),
                              0.0});
}

// A number at the beginning of the text.
int RecordNumber(const char* text, int* position, double* value) {
  const std::string_view rest(text);
  double number = 0.0;
  const auto [end, failure] =
      std::from_chars(rest.data(), rest.data() + rest.size(), number);
  const bool has_digit =
      !rest.empty() && (rest[0] == '.' || (rest[0] >= '0' && rest[0] <= '9'));
  if (failure != std::errc() || !has_digit) return 0;
  *position += static_cast<int>(end - text);
  *value = current_record->Add({Op::kNumber, 0, 0, 0, number});
  return 1;
}

double* RecordVariable(const char* name, void* /*unused*/) {
  Record& record = *current_record;
  if (std::string_view(name) == "pi") {
    record.places.push_back(record.Add({Op::kNumber, 0, 0, 0, M_PI}));
  } else {
    const auto index = static_cast<int>(record.variables.size());
    record.variables.emplace_back(name);
    record.places.push_back(record.Add({Op::kVariable, index, -1, -1, 0.0}));
  }
  return &record.places.back();
}

class FormulaParser final : public mu::ParserBase {
 public:
  FormulaParser() {
    EnableBuiltInOprt(false);
    InitCharSets();
    InitFun();
    InitOprt();
    AddValIdent(RecordNumber);
    SetVarFactory(RecordVariable);
  }

 private:
  void InitCharSets() override {
    DefineNameChars(
        "0123456789_abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ");
    DefineOprtChars("+-*/^<>=");
    DefineInfixOprtChars("+-");
  }
  void InitConst() override {}
  void InitFun() override {
    DefineFun("exp", RecordOne<Op::kExp>);
    DefineFun("log", RecordOne<Op::kLog>);
    DefineFun("log10", RecordOne<Op::kLog10>);
    DefineFun("sqrt", RecordOne<Op::kSqrt>);
    DefineFun("sin", RecordOne<Op::kSin>);
    DefineFun("cos", RecordOne<Op::kCos>);
    DefineFun("tan", RecordOne<Op::kTan>);
    DefineFun("asin", RecordOne<Op::kAsin>);
    DefineFun("acos", RecordOne<Op::kAcos>);
    DefineFun("atan", RecordOne<Op::kAtan>);
    DefineFun("sinh", RecordOne<Op::kSinh>);
    DefineFun("cosh", RecordOne<Op::kCosh>);
    DefineFun("tanh", RecordOne<Op::kTanh>);
    DefineFun("erf", RecordOne<Op::kErf>);
    DefineFun("abs", RecordOne<Op::kAbs>);
    DefineFun("atan2", RecordTwo<Op::kAtan2>);
    DefineFun("pow", RecordTwo<Op::kPower>);
    DefineFun("min", RecordTwo<Op::kMin>);
    DefineFun("max", RecordTwo<Op::kMax>);
    DefineFun("if", RecordIf);
  }
  void InitOprt() override {
    DefineInfixOprt("-", RecordOne<Op::kNegate>, mu::prINFIX);
    DefineInfixOprt("+", RecordPlus, mu::prINFIX);
    DefineOprt("<", RecordTwo<Op::kLess>, mu::prCMP);
    DefineOprt("<=", RecordTwo<Op::kLessOrEqual>, mu::prCMP);
    DefineOprt(">", RecordTwo<Op::kGreater>, mu::prCMP);
    DefineOprt(">=", RecordTwo<Op::kGreaterOrEqual>, mu::prCMP);
    DefineOprt("+", RecordTwo<Op::kAdd>, mu::prADD_SUB);
    DefineOprt("-", RecordTwo<Op::kSubtract>, mu::prADD_SUB);
    DefineOprt("*", RecordTwo<Op::kMultiply>, mu::prMUL_DIV);
    DefineOprt("/", RecordTwo<Op::kDivide>, mu::prMUL_DIV);
    DefineOprt("^", RecordTwo<Op::kPower>, mu::prPOW, mu::oaRIGHT);
    DefineOprt("**", RecordTwo<Op::kPower>, mu::prPOW, mu::oaRIGHT);
  }
};

// What muParser says, without its position, which is counted from 0.
std::string Message(const mu::ParserError& failure) {
  std::string what = failure.GetMsg();
  for (const char* end :
       {" found at position", " at expression position", " at position"}) {
    what = what.substr(0, what.find(end));
  }
  if (failure.GetToken() == "(") {
    what +=
        "; functions are exp log log10 sqrt sin cos tan asin acos atan sinh "
        "cosh tanh erf abs atan2 pow min max if";
  }
  return fmt::format("character {}: {}", failure.GetPos() + 1, Printable(what));
}

// Characters that muParser would read in another way, or not at all.
bool HasOnlyKnownCharacters(const std::string& text, std::string* error) {
  constexpr std::string_view kOthers = " \t+-*/^<>=(),._";
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool is_known =
        std::isalnum(static_cast<unsigned char>(text[i])) != 0 ||
        kOthers.find(text[i]) != std::string_view::npos;
    if (is_known) continue;
    *error = fmt::format(
        "character {}: '{}' has no meaning in a formula; conditions are "
        "if(condition, a, b)",
        i + 1,
        Printable(text.substr(i, 1)));
    return false;
  }
  return true;
}

// Sets the index of the result.
bool ParseByMuParser(const std::string& text, int* result, std::string* error) {
  try {
    FormulaParser parser;
    parser.SetExpr(text);
    *result = static_cast<int>(parser.Eval());
    if (parser.GetNumResults() == 1) return true;
    *error = "several formulas with commas between; expected one";
  } catch (const mu::ParserError& failure) {
    *error = Message(failure);
  }
  return false;
}

}  // namespace

bool Formula::Parse(const std::string& text,
                    Formula* formula,
                    std::string* error) {
  if (!HasOnlyKnownCharacters(text, error)) return false;
  Record record;
  current_record = &record;
  const bool is_parsed = ParseByMuParser(text, &formula->result_, error);
  current_record = nullptr;
  if (!is_parsed) return false;
  for (const std::string& name : record.variables) {
    if (std::isdigit(static_cast<unsigned char>(name[0])) == 0) continue;
    *error = fmt::format("'{}' is no number and no name", name);
    return false;
  }
  formula->variables_ = std::move(record.variables);
  formula->operations_ = std::move(record.operations);
  formula->SetConstants(std::vector<bool>(formula->variables_.size(), false));
  return true;
}

void Formula::SetConstants(const std::vector<bool>& are_constant) {
  CHECK_EQ(are_constant.size(), variables_.size());
  const auto is_constant = [this](int index) {
    return index < 0 || operations_[index].is_constant;
  };
  for (Operation& operation : operations_) {
    operation.is_constant =
        operation.op == Op::kNumber ||
        (operation.op == Op::kVariable
             ? are_constant[operation.a]
             : is_constant(operation.a) && is_constant(operation.b) &&
                   is_constant(operation.c));
  }
}

}  // namespace invgrad
