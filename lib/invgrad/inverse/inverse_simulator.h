// An inverse simulator carries a wanted output back to an input.
//
//   x = P^-1(y; x_0, c)   such that   P(x; c) = y
//
//   global     knows one input for every output and does not look at x_0
//   local      of all inputs that give y, the one closest to x_0 (the current
//              input): the only sensible kind where P is not injective
//   numerical  found by a solver that starts at x_0 (numerical_inverse.h)
//   Newton     steps from x_0 towards y, and may stop short of it
//              (newton_inverse.h)
//
// Shapes:  x, x_0: num_inputs of the simulator;  y: num_outputs;
//          c: num_context.
// Fails:   Invert returns false with *why set ("no pre-image: |y_0| > 1"). Who
//          calls it expects everything of an inverse that a user wrote:
//          exceptions, wrong sizes, NaN and wrong answers are caught sample by
//          sample (simulator_pull_back.h), never trusted.
// Implementations are immutable, so that several threads may share one.
//
// Source: Holl, Koltun, Thuerey. Scale-invariant Learning by Physics Inversion.
//         NeurIPS 2022, section 3.1. arXiv 2109.15048.
#ifndef INVGRAD_INVERSE_INVERSE_SIMULATOR_H_
#define INVGRAD_INVERSE_INVERSE_SIMULATOR_H_

#include <functional>
#include <string>
#include <utility>

#include "Eigen/Core"

namespace invgrad {

class InverseSimulator {
 public:
  using ConstVectorRef = Eigen::Ref<const Eigen::VectorXd>;

  virtual ~InverseSimulator() = default;

  // *x may have any size on entry; no allocation if it has the right one.
  virtual bool Invert(const ConstVectorRef& y,
                      const ConstVectorRef& x0,
                      const ConstVectorRef& context,
                      Eigen::VectorXd* x,
                      std::string* why) const = 0;

  // Whether P(x) = y is promised, to rounding or to the inverse's own
  // tolerance. Answers of one that only comes nearer are not held against y.
  virtual bool reaches_target() const { return true; }
};

// A user's function, global or local.
class FunctionInverse final : public InverseSimulator {
 public:
  using Function = std::function<bool(const ConstVectorRef& y,
                                      const ConstVectorRef& x0,
                                      const ConstVectorRef& context,
                                      Eigen::VectorXd* x,
                                      std::string* why)>;

  explicit FunctionInverse(Function function)
      : function_(std::move(function)) {}

  bool Invert(const ConstVectorRef& y,
              const ConstVectorRef& x0,
              const ConstVectorRef& context,
              Eigen::VectorXd* x,
              std::string* why) const override {
    return function_(y, x0, context, x, why);
  }

 private:
  Function function_;
};

}  // namespace invgrad

#endif  // INVGRAD_INVERSE_INVERSE_SIMULATOR_H_
