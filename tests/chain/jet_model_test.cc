// Models whose simulator's inputs are derivatives of the network.
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/internal/layered_jacobian.h"
#include "invgrad/inverse/chain_pull_back.h"
#include "invgrad/model.h"
#include "tests/support/derivatives_by_functor.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace jet_model_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

// A nonlinear equation of two functions, u and v, with a coefficient c:
//   y = (Lap u + u v_x + u_xxy / 10 - c, |grad v|^2 + sin(u) Lap v).
const std::vector<std::string> kWords = {"x", "y", "xx+yy", "xxy"};
struct Equation {
  template <typename T>
  bool operator()(const T* x, const double* c, T* y) const {
    using std::sin;
    const T *u = x, *v = x + 1;  // channels are two apart
    y[0] = u[6] + u[0] * v[2] + 0.1 * u[8] - c[0];
    y[1] = v[2] * v[2] + v[4] * v[4] + sin(u[0]) * v[6];
    return true;
  }
};

Model MakeModel(std::vector<int> hidden, Activation activation) {
  std::vector<int> widths = {2};
  widths.insert(widths.end(), hidden.begin(), hidden.end());
  widths.push_back(2);
  return Model(DenseNetwork(widths, activation),
               std::make_shared<AutoDiffSimulator<Equation, 2 * 7, 2, 1>>(),
               std::make_shared<SquaredNormLoss>(2, 0.5),
               Reduction::kMean,
               std::make_shared<DerivativeSet>("xy", kWords));
}

MatrixXd Points(int num_samples) { return RandomMatrix(2, num_samples, 11); }

DataSet MakeData(int num_samples) {
  DataSet data;
  data.inputs = DerivativeSet("xy", kWords).InputJets(Points(num_samples));
  data.contexts = RandomMatrix(1, num_samples, 12);
  data.targets = RandomMatrix(2, num_samples, 13);
  data.solutions = RandomMatrix(2 * 7, num_samples, 14);
  return data;
}

class JetModelTest : public testing::TestWithParam<Activation> {
 protected:
  JetModelTest()
      : model_(MakeModel({5, 4}, GetParam())),
        data_(MakeData(3)),
        weights_(RandomMatrix(model_.num_weights(), 1, 15)) {
    LinearizationParts parts;
    parts.gradient = parts.jacobian = parts.hessian = true;
    std::string error;
    EXPECT_TRUE(
        model_.Linearize(weights_, data_, parts, &linearization_, &error))
        << error;
    linearization_.jacobian->ToDense(&J_);
  }

  // y of the batch, by Jets of Jets for the network's derivatives.
  VectorXd Outputs(const VectorXd& weights) const {
    VectorXd y(2 * data_.num_samples());
    const MatrixXd points = Points(data_.num_samples());
    for (int s = 0; s < data_.num_samples(); ++s) {
      const MatrixXd x = JetsByFunctor(*model_.derivatives(),
                                       "xy",
                                       *model_.dense_network(),
                                       weights,
                                       points.col(s));
      EXPECT_TRUE(
          Equation()(x.data(), data_.contexts.col(s).data(), y.data() + 2 * s));
    }
    return y;
  }
  VectorXd Gradient(const VectorXd& weights) const {
    LinearizationParts parts;
    parts.gradient = true;
    Linearization at_weights;
    std::string error;
    EXPECT_TRUE(model_.Linearize(weights, data_, parts, &at_weights, &error));
    return at_weights.gradient;
  }

  static constexpr double kStep = 1e-5;
  // h^2 / 6 times third derivatives below a thousand, and eps / h.
  static constexpr double kDifference = 1e-7;

  const Model model_;
  const DataSet data_;
  const VectorXd weights_;
  Linearization linearization_;
  MatrixXd J_;
};

TEST_P(JetModelTest, PredictsTheEquationOfTheJets) {
  MatrixXd y;
  std::string error;
  ASSERT_TRUE(model_.Predict(weights_, data_, &y, &error)) << error;
  EXPECT_LT((VectorXd(y.reshaped()) - Outputs(weights_)).norm(), kRounding);
}

TEST_P(JetModelTest, JacobianIsThatOfTheOutputs) {
  for (int k = 0; k < model_.num_weights(); ++k) {
    const VectorXd h = kStep * VectorXd::Unit(model_.num_weights(), k);
    const VectorXd difference =
        (Outputs(weights_ + h) - Outputs(weights_ - h)) / (2.0 * kStep);
    EXPECT_LT((J_.col(k) - difference).norm(), kDifference) << "weight " << k;
  }
}

TEST_P(JetModelTest, ProductsAreThoseOfTheDenseJacobian) {
  const JacobianOperator& J = *linearization_.jacobian;
  const VectorXd v = RandomMatrix(J.cols(), 1, 21);
  const VectorXd w = RandomMatrix(J.rows(), 1, 22);
  VectorXd Jv, Jtw;
  J.Times(v, &Jv);
  J.TransposeTimes(w, &Jtw);
  EXPECT_LT((Jv - J_ * v).norm(), kRounding);
  EXPECT_LT((Jtw - J_.transpose() * w).norm(), kRounding);
  EXPECT_NEAR(Jv.dot(w), Jtw.dot(v), kRounding);
  MatrixXd gram, parameter_gram;
  J.Gram(&gram);
  J.ParameterGram(&parameter_gram);
  const auto lower = [](const MatrixXd& A) -> MatrixXd {
    return A.triangularView<Eigen::Lower>();
  };
  EXPECT_LT((lower(gram) - lower(J_ * J_.transpose())).norm(),
            kRounding * J_.squaredNorm());
  EXPECT_LT((lower(parameter_gram) - lower(J_.transpose() * J_)).norm(),
            kRounding * J_.squaredNorm());
}

TEST_P(JetModelTest, LayersAreTheColumnsOfTheJacobian) {
  const auto blocks = ColumnBlocksOf(*linearization_.jacobian);
  ASSERT_EQ(blocks.size(), 3u);
  for (std::size_t l = 0; l < blocks.size(); ++l) {
    MatrixXd block;
    blocks[l]->ToDense(&block);
    EXPECT_LT(
        (block - J_.middleCols(model_.dense_network()->offset(l), block.cols()))
            .norm(),
        kRounding);
  }
}

TEST_P(JetModelTest, BothWaysToTheGradientAgree) {
  const VectorXd expected = J_.transpose() * linearization_.loss_gradient;
  EXPECT_LT((linearization_.gradient - expected).norm(),
            kRounding * (1.0 + expected.norm()));
  EXPECT_LT((Gradient(weights_) - expected).norm(),
            kRounding * (1.0 + expected.norm()));
}

TEST_P(JetModelTest, HessianIsTheDerivativeOfTheGradient) {
  const MatrixXd& H = linearization_.hessian;
  const double scale = std::max(1.0, H.cwiseAbs().maxCoeff());
  EXPECT_LT((H - H.transpose()).cwiseAbs().maxCoeff(), kRounding * scale);
  for (int k = 0; k < model_.num_weights(); ++k) {
    const VectorXd h = kStep * VectorXd::Unit(model_.num_weights(), k);
    const VectorXd difference =
        (Gradient(weights_ + h) - Gradient(weights_ - h)) / (2.0 * kStep);
    EXPECT_LT((H.col(k) - difference).cwiseAbs().maxCoeff(),
              kDifference * scale)
        << "weight " << k;
  }
}

INSTANTIATE_TEST_SUITE_P(Activations,
                         JetModelTest,
                         testing::ValuesIn(kSmoothActivations),
                         [](const auto& info) {
                           return ActivationName(info.param);
                         });

// Lap u of u = sum_k v_k tanh(z_k) + c, z_k = w_k . a + b_k, in closed form
// for any scalar type of the weights.
struct LaplacianOfOneLayer {
  template <typename T>
  T operator()(const T* weights, int num_hidden, const Vector2d& a) const {
    using std::tanh;
    T sum(0.0);
    for (int k = 0; k < num_hidden; ++k) {
      const T* w = weights + 3 * k;
      const T t = tanh(w[0] * a[0] + w[1] * a[1] + w[2]);
      sum += weights[3 * num_hidden + k] * (-2.0) * t * (1.0 - t * t) *
             (w[0] * w[0] + w[1] * w[1]);
    }
    return sum;
  }
};

// Lap u, of the set (u, u_x, u_y, Lap u).
struct LaplaceEquation {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = x[3];
    return true;
  }
};

std::shared_ptr<const DerivativeSet> LaplaceSet() {
  return std::make_shared<DerivativeSet>(
      "xy", std::vector<std::string>{"x", "y", "xx+yy"});
}

// To rounding errors: no difference quotient.
TEST(JetModel, DerivativesOfALaplacianAreTheClosedForm) {
  constexpr int kHidden = 4;
  constexpr int kWeights = 4 * kHidden + 1;
  const Model model(
      DenseNetwork({2, kHidden, 1}, Activation::kTanh),
      std::make_shared<AutoDiffSimulator<LaplaceEquation, 4, 1>>(),
      std::make_shared<DotProductLoss>(1),
      Reduction::kSum,
      LaplaceSet());
  const Vector2d point(0.4, -0.7);
  DataSet data;
  data.inputs = LaplaceSet()->InputJets(point);
  data.targets = MatrixXd::Ones(1, 1);
  const VectorXd weights = RandomMatrix(kWeights, 1, 31);
  LinearizationParts parts;
  parts.gradient = parts.hessian = true;
  Linearization linearization;
  std::string error;
  ASSERT_TRUE(model.Linearize(weights, data, parts, &linearization, &error))
      << error;
  std::vector<NestedJet<kWeights>> jets(kWeights);
  for (int k = 0; k < kWeights; ++k) {
    jets[k] = MakeHessianJet<kWeights>(weights[k], k);
  }
  const auto y = LaplacianOfOneLayer()(jets.data(), kHidden, point);
  EXPECT_NEAR(linearization.cost, y.a.a, 1e-14);
  for (int k = 0; k < kWeights; ++k) {
    EXPECT_NEAR(linearization.gradient[k], y.v[k].a, 1e-13) << k;
    EXPECT_LT((linearization.hessian.col(k) - VectorXd(y.v[k].v)).norm(), 1e-12)
        << k;
  }
}

TEST(JetModel, FailureNamesTheSampleNotTheChannel) {
  const Model model = MakeModel({3}, Activation::kTanh);
  DataSet data = MakeData(3);
  data.inputs(1, 2) = std::numeric_limits<double>::quiet_NaN();
  double cost = 0.0;
  std::string error;
  EXPECT_FALSE(
      model.Cost(VectorXd::Ones(model.num_weights()), data, &cost, &error));
  EXPECT_NE(error.find("sample 2:"), std::string::npos) << error;
}

TEST(JetModel, CopiesKeepTheJets) {
  const Model model = MakeModel({3}, Activation::kTanh);
  const Model again =
      model.WithNetwork(DenseNetwork({2, 7, 2}, Activation::kGelu))
          .WithLoss(std::make_shared<SquaredNormLoss>(2, 1.0), Reduction::kSum);
  EXPECT_EQ(again.derivatives(), model.derivatives());
}

TEST(JetModelDeathTest, SimulatorMustTakeAllChannels) {
  EXPECT_DEATH(
      Model(DenseNetwork({2, 3, 2}, Activation::kTanh),
            std::make_shared<AutoDiffSimulator<LaplaceEquation, 4, 1>>(),
            std::make_shared<SquaredNormLoss>(1, 0.5),
            Reduction::kMean,
            LaplaceSet()),
      "the simulator's inputs");
}

// Supervised training wants solutions - x of the jets. Its linearization is
// that of 1/2 |x - x~|^2.
TEST(JetModel, PullBacksTrainAllChannels) {
  const Model model = MakeModel({4}, Activation::kTanh);
  const DataSet data = MakeData(5);
  const VectorXd weights = RandomMatrix(model.num_weights(), 1, 41);
  ChainPullBack::Options options;
  options.simulator.way = SimulatorWay::kData;
  ChainPullBack pull_back(&model, nullptr, options);
  LinearizationParts parts;
  parts.gradient = parts.jacobian = parts.hessian = true;
  Linearization proxy;
  std::string error;
  ASSERT_TRUE(pull_back.Linearize(weights, data, parts, &proxy, &error))
      << error;
  const auto loss = [&](const VectorXd& at) {
    double sum = 0.0;
    for (int s = 0; s < data.num_samples(); ++s) {
      const MatrixXd x = JetsByFunctor(*model.derivatives(),
                                       "xy",
                                       *model.dense_network(),
                                       at,
                                       Points(5).col(s));
      sum += (VectorXd(x.reshaped()) - data.solutions.col(s)).squaredNorm();
    }
    return 0.5 * sum / data.num_samples();
  };
  VectorXd through_jacobian;
  proxy.jacobian->TransposeTimes(proxy.loss_gradient, &through_jacobian);
  EXPECT_LT((through_jacobian - proxy.gradient).norm(), kRounding);
  constexpr double h = 1e-4;
  for (int k = 0; k < model.num_weights(); ++k) {
    const VectorXd d = h * VectorXd::Unit(model.num_weights(), k);
    const double above = loss(weights + d);
    const double below = loss(weights - d);
    EXPECT_NEAR(proxy.gradient[k], (above - below) / (2.0 * h), 1e-6) << k;
    EXPECT_NEAR(proxy.hessian(k, k),
                (above - 2.0 * loss(weights) + below) / (h * h),
                1e-5)
        << k;
  }
}

}  // namespace jet_model_test
}  // namespace invgrad
