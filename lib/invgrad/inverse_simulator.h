// An inverse simulator maps a wanted output to an input.
//
//   x = P^-1(y; x_now, c)   such that   P(x; c) = y
//
//   global     returns one input for every output and does not read x_now
//   local      of all inputs that give y, returns the one closest to x_now, the
//              current input: the only sensible kind where P is not injective
//   numerical  a solver that starts at x_now (numerical_inverse.h)
//   Newton     steps from x_now towards y, and may stop short of it
//              (newton_inverse.h)
//
// A user's inverse is a function, with or without the sample's context c:
//
//   auto inverse = Inverse([](const auto& y, const auto& x_now)
//                              -> std::optional<Eigen::VectorXd> {
//     if (y[0] < 0.0) return std::nullopt;
//     return Eigen::VectorXd(y.cwiseSqrt());
//   });
//
// Shapes:  x, x_now: num_inputs of the simulator;  y: num_outputs;
//          c: num_context.
// Fails:   std::nullopt, or Invert returns false with *why set ("no pre-image:
//          |y_0| > 1"). SimulatorPullBack (simulator_pull_back.h) detects
//          exceptions, wrong sizes, NaN and wrong results, sample by sample.
// Implementations are immutable, so that several threads may share one.
//
// Source: Holl, Koltun, Thuerey. Scale-invariant Learning by Physics Inversion.
//         NeurIPS 2022, section 3.1. arXiv 2109.15048.
#ifndef INVGRAD_INVERSE_SIMULATOR_H_
#define INVGRAD_INVERSE_SIMULATOR_H_

#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "Eigen/Core"

namespace invgrad {

class InverseSimulator {
 public:
  using ConstVectorRef = Eigen::Ref<const Eigen::VectorXd>;

  virtual ~InverseSimulator() = default;

  // *x may have any size on entry; the right size avoids an allocation.
  virtual bool Invert(const ConstVectorRef& y,
                      const ConstVectorRef& x_now,
                      const ConstVectorRef& context,
                      Eigen::VectorXd* x,
                      std::string* why) const = 0;

  // Whether P(x) = y holds, to rounding or to the inverse's own tolerance. If
  // not, the result is not tested against y.
  virtual bool reaches_target() const { return true; }
};

// "the inverse has no x for y = (1.25, -3, 0.5, ...)"
std::string NoInverse(const InverseSimulator::ConstVectorRef& y);

template <typename Function>
class FunctionInverse final : public InverseSimulator {
 public:
  explicit FunctionInverse(Function function)
      : function_(std::move(function)) {}

  bool Invert(const ConstVectorRef& y,
              const ConstVectorRef& x_now,
              const ConstVectorRef& context,
              Eigen::VectorXd* x,
              std::string* why) const override {
    std::optional<Eigen::VectorXd> result = Call(y, x_now, context);
    if (!result.has_value()) {
      *why = NoInverse(y);
      x->resize(0);
      return false;
    }
    *x = *std::move(result);
    return true;
  }

 private:
  using Vector = const ConstVectorRef&;

  std::optional<Eigen::VectorXd> Call(Vector y,
                                      Vector x_now,
                                      [[maybe_unused]] Vector context) const {
    if constexpr (std::
                      is_invocable_v<const Function&, Vector, Vector, Vector>) {
      return function_(y, x_now, context);
    } else {
      static_assert(std::is_invocable_v<const Function&, Vector, Vector>,
                    "Inverse takes a function of (y, x_now) or of (y, x_now, "
                    "context) that returns std::optional<Eigen::VectorXd>");
      return function_(y, x_now);
    }
  }

  Function function_;
};

// The inverse simulator of function(y, x_now) or function(y, x_now, context),
// which returns x or std::nullopt; several threads may call it at once.
template <typename Function>
std::shared_ptr<const InverseSimulator> Inverse(Function function) {
  return std::make_shared<FunctionInverse<Function>>(std::move(function));
}

}  // namespace invgrad

#endif  // INVGRAD_INVERSE_SIMULATOR_H_
