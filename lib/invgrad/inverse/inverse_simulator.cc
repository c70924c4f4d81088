#include "invgrad/inverse/inverse_simulator.h"

#include <algorithm>

#include "fmt/format.h"
#include "glog/logging.h"

namespace invgrad {
namespace {

using ConstVectorRef = InverseSimulator::ConstVectorRef;

// "(1.25, -3, 0.5, ...)"
std::string ShortText(const ConstVectorRef& v) {
  constexpr Eigen::Index kMaxNumEntries = 3;
  const Eigen::Index shown = std::min(v.size(), kMaxNumEntries);
  return fmt::format("({:.4g}{})",
                     fmt::join(v.data(), v.data() + shown, ", "),
                     shown < v.size() ? ", ..." : "");
}

class FunctionInverse final : public InverseSimulator {
 public:
  explicit FunctionInverse(InverseFunction function)
      : function_(std::move(function)) {
    CHECK(function_ != nullptr);
  }

  bool Invert(const ConstVectorRef& y,
              const ConstVectorRef& x_now,
              const ConstVectorRef& context,
              Eigen::VectorXd* x,
              std::string* why) const override {
    std::optional<Eigen::VectorXd> result = function_(y, x_now, context);
    if (result.has_value()) {
      *x = *std::move(result);
      return true;
    }
    x->resize(0);
    *why = "the inverse has no x for y = " + ShortText(y);
    return false;
  }

 private:
  InverseFunction function_;
};

}  // namespace

std::shared_ptr<const InverseSimulator> InverseWithContext(
    InverseFunction function) {
  return std::make_shared<FunctionInverse>(std::move(function));
}

}  // namespace invgrad
