#include <string>
#include <vector>

#include "ceres/autodiff_cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/sized_cost_function.h"
#include "gtest/gtest.h"
#include "invgrad/separable.h"
#include "tests/separable/exponentials.h"

namespace invgrad {
namespace separable_problem_refusals_test {

void ExpectHas(const std::string& text, const std::string& part) {
  EXPECT_NE(text.find(part), std::string::npos) << text;
}

std::string Refusal(const std::vector<LinearBlock>& linear,
                    ceres::Problem* problem,
                    const SeparableProblem::Options& options = {}) {
  std::string error;
  EXPECT_EQ(SeparableProblem::Create(options, linear, problem, &error),
            nullptr);
  return error;
}

struct Product {
  template <typename T>
  bool operator()(const T* b, const T* c, T* r) const {
    r[0] = b[0] * c[0] - 6.0;
    return true;
  }
};

TEST(SeparableProblemRefusals, NamesABlockThatIsNotLinear) {
  Exponentials data(20);
  ceres::Problem problem;
  data.AddTo(&problem);
  SeparableProblem::Options options;
  options.block_name = [&data](const double* values) {
    return values == data.a.data() ? "rates" : "amplitudes";
  };
  const std::string error = Refusal({{data.a.data(), {1}}}, &problem, options);
  ExpectHas(error, "residual block ");
  ExpectHas(error, "the derivative by `rates`[1] changes by 0.");
  ExpectHas(error, "(allowed: 1e-08); leave `rates`[1]");
  // b and c in b c: each alone is linear, both are not.
  double b = 2.0;
  double c = 3.0;
  ceres::Problem product;
  product.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Product, 1, 1, 1>(new Product),
      nullptr,
      &b,
      &c);
  ExpectHas(Refusal({{&b, {}}, {&c, {}}}, &product),
            "or a parameter that multiplies it, out of the");
}

struct Sine {
  template <typename T>
  bool operator()(const T* c, T* r) const {
    using std::sin;
    r[0] = sin(c[0]) - 0.5;
    return true;
  }
};

// sin(c) is affine up to 1e-13 at c = 1e-6 alone; found, because a parameter
// may be of size 1.
TEST(SeparableProblemRefusals, DoesNotBelieveSmallValues) {
  double c = 1e-6;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Sine, 1, 1>(new Sine), nullptr, &c);
  ExpectHas(Refusal({{&c, {}}}, &problem), "not affine");
}

class WrongJacobian final : public ceres::SizedCostFunction<1, 1> {
 public:
  bool Evaluate(double const* const* x,
                double* r,
                double** jacobians) const override {
    r[0] = 2.0 * x[0][0] - 1.0;
    if (jacobians != nullptr && jacobians[0] != nullptr) jacobians[0][0] = 2.1;
    return true;
  }
};

TEST(SeparableProblemRefusals, NamesAWrongJacobian) {
  double c = 1.0;
  ceres::Problem problem;
  problem.AddResidualBlock(new WrongJacobian, nullptr, &c);
  ExpectHas(Refusal({{&c, {}}}, &problem),
            "by the linear parameter block 0[0] is constant, but "
            "wrong by 0.0");
}

TEST(SeparableProblemRefusals, RefusesBoundsManifoldsAndLosses) {
  Exponentials data(20);
  ceres::Problem problem;
  data.AddTo(&problem);
  problem.SetParameterLowerBound(data.c.data(), 1, 0.0);
  ExpectHas(Refusal({{data.c.data(), {}}}, &problem),
            "block 0[1] has bounds; leave it out of the linear");
  std::string error;  // what the message says works
  EXPECT_NE(
      SeparableProblem::Create({}, {{data.c.data(), {0}}}, &problem, &error),
      nullptr)
      << error;
  problem.SetManifold(data.c.data(), new ceres::SubsetManifold(2, {0}));
  ExpectHas(Refusal({{data.c.data(), {}}}, &problem),
            "block 0 is linear and has a manifold");

  ceres::Problem robust;
  data.AddTo(&robust, [] {
    return new ceres::ScaledLoss(nullptr, -1.0, ceres::TAKE_OWNERSHIP);
  });
  ExpectHas(Refusal({{data.c.data(), {}}}, &robust),
            "needs a loss with rho >= 0 and rho' >= 0");
  ceres::Problem huber;
  data.AddTo(&huber, [] { return new ceres::HuberLoss(1.0); });
  SeparableProblem::Options options;
  options.is_golub_pereyra = true;
  ExpectHas(Refusal({{data.c.data(), {}}}, &huber, options), "take Kaufman's");
}

TEST(SeparableProblemRefusals, NamesAResidualBlockThatFails) {
  Exponentials data(3);
  data.a[1] = -1e4;  // exp(4e4) overflows
  ceres::Problem problem;
  data.AddTo(&problem);
  ExpectHas(Refusal({{data.c.data(), {}}}, &problem),
            "residual block 1: a residual or a derivative is not "
            "finite");
}

TEST(SeparableProblemDeathTest, OfABlockOfAnotherProblem) {
  double c = 1.0;
  ceres::Problem problem;
  std::string error;
  EXPECT_DEATH(SeparableProblem::Create({}, {{&c, {}}}, &problem, &error),
               "not part of the problem");
}

}  // namespace separable_problem_refusals_test
}  // namespace invgrad
