#include "invgrad/chain/chain_jacobian.h"

#include <cmath>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/autodiff_loss.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/field_simulator.h"
#include "invgrad/loss.h"
#include "invgrad/model.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace chain_jacobian_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// y = (x0 x1, sin x0, x1^3).
struct Curved {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::sin;
    y[0] = x[0] * x[1];
    y[1] = sin(x[0]);
    y[2] = x[1] * x[1] * x[1];
    return true;
  }
};
using CurvedSimulator = AutoDiffSimulator<Curved, 2, 3>;

// The same, by products.
class CurvedField final : public FieldSimulator {
 public:
  int num_inputs() const override { return 2; }
  int num_outputs() const override { return 3; }
  bool Value(const double* x, const double* context, double* y) const override {
    return curved_.Evaluate(x, context, y, nullptr);
  }
  std::unique_ptr<const JacobianOperator> Linearize(const double* x,
                                                    const double* context,
                                                    double* y) const override {
    return curved_.Linearize(x, context, y);
  }

 private:
  CurvedSimulator curved_;
};

// L = sum_i cosh(y_i - y*_i).
struct CoshSum {
  template <typename T>
  bool operator()(const T* y, const double* target, T* loss) const {
    using std::cosh;
    *loss = T(0.0);
    for (int i = 0; i < 3; ++i) *loss += cosh(y[i] - target[i]);
    return true;
  }
};

class ChainJacobianTest : public testing::TestWithParam<bool> {
 protected:
  // A model with the factors of J, and one with its products.
  Model Make(bool with_factors) const {
    const std::shared_ptr<const Simulator> simulator =
        with_factors ? std::shared_ptr<const Simulator>(new CurvedSimulator)
                     : std::make_shared<CurvedField>();
    const std::shared_ptr<const Loss> loss =
        GetParam() ? std::shared_ptr<const Loss>(new SquaredNormLoss(3, 0.5))
                   : std::make_shared<AutoDiffLoss<CoshSum, 3>>();
    return Model(DenseNetwork({2, 5, 2}, Activation::kTanh),
                 simulator,
                 loss,
                 Reduction::kMean);
  }
  Linearization Linearized(const Model& model,
                           const LinearizationParts& parts) const {
    Linearization at;
    std::string error;
    EXPECT_TRUE(model.Linearize(weights_, data_, parts, &at, &error)) << error;
    return at;
  }
  ChainJacobianTest() {
    data_.inputs = RandomMatrix(2, 4, 1);
    data_.contexts.resize(0, 4);
    data_.targets = RandomMatrix(3, 4, 2);
    weights_ = RandomMatrix(Make(true).num_weights(), 1, 3);
  }

  DataSet data_;
  VectorXd weights_;
};

TEST_P(ChainJacobianTest, ProductsAgreeWithTheFactors) {
  LinearizationParts parts = LinearizationParts::Jacobian();
  parts.gradient = true;
  const Linearization factors = Linearized(Make(true), parts);
  const Linearization products = Linearized(Make(false), parts);
  constexpr double kTolerance = 1e-14;  // sums of ten terms of order one
  EXPECT_NEAR(products.cost, factors.cost, kTolerance);
  EXPECT_LT((products.gradient - factors.gradient).norm(), kTolerance);
  EXPECT_LT((products.loss_gradient - factors.loss_gradient).norm(),
            kTolerance);
  const VectorXd r = RandomMatrix(12, 1, 4);
  EXPECT_LT(
      (products.loss_hessian_times(r) - factors.loss_hessian_times(r)).norm(),
      kTolerance);
  MatrixXd J, expected;
  products.jacobian->ToDense(&J);
  factors.jacobian->ToDense(&expected);
  EXPECT_LT((J - expected).norm(), 10.0 * kTolerance);
  const VectorXd v = RandomMatrix(J.cols(), 1, 5);
  VectorXd Jv, Jtr;
  products.jacobian->Times(v, &Jv);
  products.jacobian->TransposeTimes(r, &Jtr);
  EXPECT_LT((Jv - expected * v).norm(), 10.0 * kTolerance);
  EXPECT_LT((Jtr - expected.transpose() * r).norm(), 10.0 * kTolerance);
  EXPECT_EQ(products.jacobian->RowName(7), factors.jacobian->RowName(7));
  EXPECT_EQ(products.jacobian->RowName(7), "row 7 (sample 2, output 1)");
}

TEST_P(ChainJacobianTest, ThereIsNoExactHessian) {
  LinearizationParts parts;
  parts.hessian = true;
  Linearization at;
  std::string error;
  EXPECT_FALSE(Make(false).Linearize(weights_, data_, parts, &at, &error));
  EXPECT_EQ(error.rfind("the exact Hessian needs a DenseNetwork", 0), 0u);
}

TEST_P(ChainJacobianTest, AFailingSampleIsNamed) {
  data_.inputs(0, 2) = std::nan("");
  Linearization at;
  std::string error;
  EXPECT_FALSE(Make(false).Linearize(
      weights_, data_, LinearizationParts::Jacobian(), &at, &error));
  EXPECT_EQ(error, "sample 2: the network's output is not finite");
}

INSTANTIATE_TEST_SUITE_P(Losses,
                         ChainJacobianTest,
                         testing::Bool(),
                         [](const auto& info) {
                           return info.param ? "Squares" : "General";
                         });

}  // namespace chain_jacobian_test
}  // namespace invgrad
