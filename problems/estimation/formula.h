// A formula that a user writes, such as "b1*(1 - exp(-b2*x))", evaluated on any
// scalar type, so that its derivatives are exact.
//
//   + - * / ^ (also **), -a, ( ), < <= > >= (1 or 0), numbers, pi, and
//   exp log log10 sqrt sin cos tan asin acos atan sinh cosh tanh erf abs
//   atan2(y, x) pow(a, b) min(a, b) max(a, b) if(condition, a, b)
//
// -a^b is -(a^b). log is the natural logarithm. All other names are variables.
// A condition, comparison, minimum or maximum of NaN is NaN. What depends on
// constants alone is evaluated on doubles: sqrt(x) and x^b have no derivative by
// a constant x, which would not be finite at x = 0.
//
// muParser [1] reads the text. It evaluates doubles only, and differences of
// them depend on the units of a parameter; so it is given functions that record
// what they would compute, and the record is evaluated.
//
// Cost:    of an evaluation one operation of T for each in the text.
// Fails:   Parse returns false, with "character N: what is wrong" or the like.
//
// [1] https://beltoforion.de/en/muparser
#ifndef PROBLEMS_ESTIMATION_FORMULA_H_
#define PROBLEMS_ESTIMATION_FORMULA_H_

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "ceres/jet.h"

namespace invgrad {

class Formula {
 public:
  static bool Parse(const std::string& text,
                    Formula* formula,
                    std::string* error);

  // In the order in which they appear.
  const std::vector<std::string>& variables() const { return variables_; }

  // Whether each variable is a constant: has no derivatives. At first none is.
  void SetConstants(const std::vector<bool>& are_constant);

  // `values`: of the variables.
  template <typename T>
  T Evaluate(const std::vector<T>& values) const;

  enum class Op {
    kNumber,
    kVariable,
    kNegate,
    kAdd,
    kSubtract,
    kMultiply,
    kDivide,
    kPower,
    kLess,
    kLessOrEqual,
    kGreater,
    kGreaterOrEqual,
    kExp,
    kLog,
    kLog10,
    kSqrt,
    kSin,
    kCos,
    kTan,
    kAsin,
    kAcos,
    kAtan,
    kSinh,
    kCosh,
    kTanh,
    kErf,
    kAbs,
    kAtan2,
    kMin,
    kMax,
    kIf
  };
  // `a`, `b`, `c`: earlier operations; kVariable: `a` is a variable.
  struct Operation {
    Op op = Op::kNumber;
    int a = 0;
    int b = 0;
    int c = 0;
    double number = 0.0;
    bool is_constant = false;  // see SetConstants
  };

 private:
  template <typename T>
  T EvaluateOperation(const Operation& operation,
                      const std::vector<T>& values,
                      const std::vector<T>& results) const;

  std::vector<std::string> variables_;
  std::vector<Operation> operations_;
  int result_ = 0;
};

namespace internal {

// The operations of one argument.
template <typename T>
T EvaluateFunction(Formula::Op op, const T& a) {
  using std::abs;
  using std::acos;
  using std::asin;
  using std::atan;
  using std::cos;
  using std::cosh;
  using std::erf;
  using std::exp;
  using std::log;
  using std::log10;
  using std::sin;
  using std::sinh;
  using std::sqrt;
  using std::tan;
  using std::tanh;
  switch (op) {
    case Formula::Op::kNegate:
      return -a;
    case Formula::Op::kExp:
      return exp(a);
    case Formula::Op::kLog:
      return log(a);
    case Formula::Op::kLog10:
      return log10(a);
    case Formula::Op::kSqrt:
      return sqrt(a);
    case Formula::Op::kSin:
      return sin(a);
    case Formula::Op::kCos:
      return cos(a);
    case Formula::Op::kTan:
      return tan(a);
    case Formula::Op::kAsin:
      return asin(a);
    case Formula::Op::kAcos:
      return acos(a);
    case Formula::Op::kAtan:
      return atan(a);
    case Formula::Op::kSinh:
      return sinh(a);
    case Formula::Op::kCosh:
      return cosh(a);
    case Formula::Op::kTanh:
      return tanh(a);
    case Formula::Op::kErf:
      return erf(a);
    default:
      return abs(a);
  }
}

// NaN, with derivatives of NaN.
template <typename T>
T Nan(const T& a) {
  return std::numeric_limits<double>::quiet_NaN() * a;
}

template <typename T>
T EvaluateIf(const T& condition, const T& b, const T& c) {
  if (condition > 0.0 || condition < 0.0) return b;
  return condition == 0.0 ? c : Nan(condition);
}

// Comparisons, minimum and maximum: a NaN is not lost.
template <typename T>
T EvaluateComparison(Formula::Op op, const T& a, const T& b) {
  if (!(a <= b || a > b)) return Nan(a + b);
  switch (op) {
    case Formula::Op::kLess:
      return T(a < b ? 1.0 : 0.0);
    case Formula::Op::kLessOrEqual:
      return T(a <= b ? 1.0 : 0.0);
    case Formula::Op::kGreater:
      return T(a > b ? 1.0 : 0.0);
    case Formula::Op::kGreaterOrEqual:
      return T(a >= b ? 1.0 : 0.0);
    case Formula::Op::kMin:
      return b < a ? b : a;
    default:
      return a < b ? b : a;
  }
}

inline double ValueOf(double a) { return a; }
template <typename T, int N>
double ValueOf(const ceres::Jet<T, N>& a) {
  return ValueOf(a.a);
}

// The operations of two arguments.
template <typename T>
T EvaluateOperator(Formula::Op op, const T& a, const T& b) {
  using std::atan2;
  using std::pow;
  switch (op) {
    case Formula::Op::kAdd:
      return a + b;
    case Formula::Op::kSubtract:
      return a - b;
    case Formula::Op::kMultiply:
      return a * b;
    case Formula::Op::kDivide:
      return a / b;
    case Formula::Op::kPower:
      return pow(a, b);
    case Formula::Op::kAtan2:
      return atan2(a, b);
    default:
      return EvaluateComparison(op, a, b);
  }
}

}  // namespace internal

// `results`: of the earlier operations.
template <typename T>
T Formula::EvaluateOperation(const Operation& operation,
                             const std::vector<T>& values,
                             const std::vector<T>& results) const {
  using internal::ValueOf;
  using std::pow;
  const int a = operation.a;
  const int b = operation.b;
  if (operation.op == Op::kNumber) return T(operation.number);
  if (operation.op == Op::kVariable) return values[a];
  if (operation.op == Op::kIf) {
    return internal::EvaluateIf(results[a], results[b], results[operation.c]);
  }
  if (b < 0) {
    return operation.is_constant
               ? T(internal::EvaluateFunction(operation.op,
                                              ValueOf(results[a])))
               : internal::EvaluateFunction(operation.op, results[a]);
  }
  if (operation.is_constant) {
    return T(internal::EvaluateOperator(
        operation.op, ValueOf(results[a]), ValueOf(results[b])));
  }
  if (operation.op == Op::kPower) {
    if (operations_[a].is_constant) return pow(ValueOf(results[a]), results[b]);
    // A constant power of a negative number has derivatives.
    if (operations_[b].is_constant) return pow(results[a], ValueOf(results[b]));
  }
  return internal::EvaluateOperator(operation.op, results[a], results[b]);
}

template <typename T>
T Formula::Evaluate(const std::vector<T>& values) const {
  std::vector<T> results;
  results.reserve(operations_.size());
  for (const Operation& operation : operations_) {
    results.push_back(EvaluateOperation(operation, values, results));
  }
  return results[result_];
}

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_FORMULA_H_
