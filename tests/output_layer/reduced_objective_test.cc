#include "invgrad/output_layer/reduced_objective.h"

#include <memory>
#include <string>
#include <utility>

#include "Eigen/Dense"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/internal/network_layers.h"
#include "invgrad/internal/qr.h"
#include "invgrad/linear_simulator.h"
#include "tests/support/least_squares.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace reduced_objective_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kSamples = 25;

// y = (x_0 + x_0 x_1 / 4, sin x_1, x_0 - x_1).
struct Curved {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::sin;
    y[0] = x[0] + 0.25 * x[0] * x[1];
    y[1] = sin(x[1]);
    y[2] = x[0] - x[1];
    return true;
  }
};

std::shared_ptr<const Simulator> LinearPhysics() {
  const MatrixXd A = RandomMatrix(3, 2, 21);
  return std::make_shared<LinearSimulator>(A.sparseView(),
                                           VectorXd(RandomMatrix(3, 1, 22)));
}
std::shared_ptr<const Simulator> CurvedPhysics() {
  return std::make_shared<AutoDiffSimulator<Curved, 2, 3>>();
}

Model MakeChain(std::shared_ptr<const Simulator> simulator,
                int num_hidden = 4) {
  return Model(DenseNetwork({2, num_hidden, 2}, Activation::kTanh),
               std::move(simulator),
               std::make_shared<SquaredNormLoss>(3, 0.7),
               Reduction::kMean);
}

DataSet RandomSamples(int num_samples = kSamples) {
  DataSet data;
  data.inputs = RandomMatrix(2, num_samples, 23);
  data.contexts.resize(0, num_samples);
  data.solutions.resize(0, num_samples);
  data.targets = RandomMatrix(3, num_samples, 24);
  return data;
}

ReducedObjective Reduced(const Model& model, const DataSet* train = nullptr) {
  return {std::make_unique<ModelObjective>(model), &model, train};
}

// theta with its best output layer. For a simulator that is not linear a solution
// is a few Gauss-Newton steps, which converge linearly where residuals are left.
VectorXd Solved(const Model& model,
                ReducedObjective* reduced,
                const DataSet& data,
                VectorXd weights) {
  std::string error;
  const int num_solutions = model.simulator().is_linear() ? 1 : 40;
  for (int k = 0; k < num_solutions; ++k) {
    EXPECT_TRUE(reduced->SolveOutputLayer(data, &weights, &error)) << error;
  }
  EXPECT_EQ(weights.size(), model.num_weights());
  return weights;
}

Linearization At(BatchObjective* objective,
                 const VectorXd& weights,
                 const DataSet& data) {
  LinearizationParts parts = LinearizationParts::Jacobian();
  parts.gradient = true;
  Linearization at;
  std::string error;
  EXPECT_TRUE(objective->Linearize(weights, data, parts, &at, &error)) << error;
  return at;
}

// The Jacobian in the output layer, the last columns.
MatrixXd LayerJacobianOf(const Model& model,
                         const VectorXd& weights,
                         const DataSet& data) {
  ModelObjective whole(model);
  MatrixXd J;
  At(&whole, weights, data).jacobian->ToDense(&J);
  return J.rightCols(OutputLayerOf(model.network()).size());
}

class ReducedLoss
    : public ::testing::TestWithParam<std::shared_ptr<const Simulator>> {
 protected:
  const Model model_ = MakeChain(GetParam());
  const DataSet data_ = RandomSamples();
  ReducedObjective reduced_ = Reduced(model_);
  const VectorXd weights_ = Solved(
      model_, &reduced_, data_, RandomMatrix(model_.num_weights(), 1, 25));

  // L*(u + step).
  double CostAfter(const VectorXd& step) {
    VectorXd weights = weights_;
    reduced_.AddStep(step, &weights);
    return At(&reduced_, Solved(model_, &reduced_, data_, weights), data_).cost;
  }
  // y of all samples at u + step.
  VectorXd OutputsAfter(const VectorXd& step) {
    VectorXd weights = weights_;
    reduced_.AddStep(step, &weights);
    weights = Solved(model_, &reduced_, data_, weights);
    MatrixXd y;
    std::string error;
    EXPECT_TRUE(model_.Predict(weights, data_, &y, &error)) << error;
    return y.reshaped();
  }
};

TEST_P(ReducedLoss, TheLayerIsTheBest) {
  ModelObjective whole(model_);
  const VectorXd gradient = At(&whole, weights_, data_).gradient;
  const VectorXd in_layer =
      gradient.tail(OutputLayerOf(model_.network()).size());
  EXPECT_LT(in_layer.norm(), 1e-7 * (1.0 + gradient.norm()));
}

TEST_P(ReducedLoss, TheGradientIsThatOfDifferences) {
  const Linearization at = At(&reduced_, weights_, data_);
  const VectorXd u = reduced_.Unknowns(weights_);
  ASSERT_EQ(at.gradient.size(), u.size());
  constexpr double kStep = 1e-4;
  for (int i = 0; i < u.size(); ++i) {
    const VectorXd step = kStep * VectorXd::Unit(u.size(), i);
    const double difference =
        (CostAfter(step) - CostAfter(-step)) / (2.0 * kStep);
    // The third derivative, and the layer's own tolerance over the step.
    EXPECT_NEAR(at.gradient[i], difference, 1e-6) << i;
  }
}

// The derivative of Golub and Pereyra is Kaufman's with a term inside the range
// of J_C, which is orthogonal to the residuals.
TEST_P(ReducedLoss, TheJacobianIsKaufmans) {
  const Linearization at = At(&reduced_, weights_, data_);
  MatrixXd kaufman;
  at.jacobian->ToDense(&kaufman);
  const MatrixXd J_C = LayerJacobianOf(model_, weights_, data_);
  const MatrixXd Q = Orthonormalized(J_C);
  const bool is_linear = model_.simulator().is_linear();
  constexpr double kStep = 1e-4;
  for (int i = 0; i < kaufman.cols(); ++i) {
    const VectorXd step = kStep * VectorXd::Unit(kaufman.cols(), i);
    const VectorXd golub_pereyra =
        (OutputsAfter(step) - OutputsAfter(-step)) / (2.0 * kStep);
    const VectorXd outside =
        golub_pereyra - Q * (Q.transpose() * golub_pereyra);
    EXPECT_LT((outside - kaufman.col(i)).norm(), 1e-6) << i;
    if (is_linear) {
      EXPECT_LT((Q.transpose() * kaufman.col(i)).norm(), 1e-8) << i;
    }
    EXPECT_NEAR(at.loss_gradient.dot(golub_pereyra), at.gradient[i], 1e-6) << i;
    EXPECT_NEAR(at.loss_gradient.dot(kaufman.col(i)), at.gradient[i], 1e-6);
  }
}

INSTANTIATE_TEST_SUITE_P(ReducedObjective,
                         ReducedLoss,
                         ::testing::Values(LinearPhysics(), CurvedPhysics()),
                         [](const auto& info) {
                           return info.index == 0 ? "Linear" : "Curved";
                         });

// In y, and from a dense least-squares problem of all of C.
TEST(ReducedObjective, TheCostIsThatOfADenseMinimization) {
  for (const bool of_batch : {true, false}) {
    const Model model = MakeChain(LinearPhysics());
    const DataSet data = RandomSamples();
    ReducedObjective reduced = Reduced(model, of_batch ? nullptr : &data);
    const VectorXd start = RandomMatrix(model.num_weights(), 1, 26);
    // The ridge of cross-validation leaves a part: these targets are noise.
    const VectorXd weights = Solved(model, &reduced, data, start);
    ModelObjective whole(model);
    const Linearization at = At(&whole, start, data);
    const MatrixXd J_C = LayerJacobianOf(model, start, data);
    // 1/2 c |y + J_C Z - y*|^2 with g = c (y - y*), c = 2 * 0.7 / N.
    const double c = 1.4 / kSamples;
    const VectorXd r = at.loss_gradient / c;
    const VectorXd left = r - J_C * LeastSquares(J_C, r);
    const double best = 0.5 * c * left.squaredNorm();
    const double cost = At(&whole, weights, data).cost;
    EXPECT_GE(cost, best * (1.0 - 1e-12));
    EXPECT_LT(cost, of_batch ? best * (1.0 + 1e-10) : at.cost);
    EXPECT_EQ(reduced.Unknowns(weights), reduced.Unknowns(start));
  }
}

// Features that are recombined: hidden neurons in another order and of another
// sign, which tanh carries through.
TEST(ReducedObjective, RecombinedFeaturesGiveTheSameLossAndGradient) {
  const Model model = MakeChain(CurvedPhysics());
  const DataSet data = RandomSamples();
  ReducedObjective reduced = Reduced(model);
  VectorXd start = RandomMatrix(model.num_weights(), 1, 27);
  // A neuron has 3 weights.
  VectorXd other = start;
  other.segment(0, 3) = -start.segment(6, 3);
  other.segment(6, 3) = start.segment(0, 3);
  // From the same outputs, because Gauss-Newton starts there.
  start.tail(10).setZero();
  other.tail(10).setZero();
  const Linearization at =
      At(&reduced, Solved(model, &reduced, data, start), data);
  const Linearization there =
      At(&reduced, Solved(model, &reduced, data, other), data);
  EXPECT_NEAR(at.cost, there.cost, 1e-10);
  EXPECT_LT((at.gradient.segment(6, 3) + there.gradient.segment(0, 3)).norm(),
            1e-8);
}

TEST(ReducedObjective, EqualNeurons) {
  const Model model = MakeChain(LinearPhysics());
  const DataSet data = RandomSamples();
  ReducedObjective reduced = Reduced(model);
  VectorXd start = RandomMatrix(model.num_weights(), 1, 28);
  start.segment(3, 3) = start.segment(0, 3);
  const VectorXd weights = Solved(model, &reduced, data, start);
  EXPECT_TRUE(weights.allFinite());
  const MatrixXd J_C = LayerJacobianOf(model, start, data);
  const VectorXd g = At(&reduced, weights, data).loss_gradient;
  EXPECT_LT((J_C.transpose() * g).norm(), 1e-10);
}

TEST(ReducedObjective, MoreFeaturesThanSamples) {
  const Model model = MakeChain(LinearPhysics(), 20);
  const DataSet data = RandomSamples(6);
  ReducedObjective reduced = Reduced(model);
  const VectorXd weights =
      Solved(model, &reduced, data, RandomMatrix(model.num_weights(), 1, 29));
  // Three outputs of two inputs: what the simulator cannot reach is left.
  const MatrixXd J_C = LayerJacobianOf(model, weights, data);
  const Linearization at = At(&reduced, weights, data);
  EXPECT_LT((J_C.transpose() * at.loss_gradient).norm(), 1e-8);
  MatrixXd J;
  at.jacobian->ToDense(&J);
  EXPECT_LT(J.norm(), 1e-6);
  EXPECT_LT(at.gradient.norm(), 1e-8);
}

TEST(ReducedObjective, SharesAreSolvedInTurn) {
  const Model model = MakeChain(LinearPhysics());
  const DataSet data = RandomSamples(400);
  const VectorXd start = RandomMatrix(model.num_weights(), 1, 30);
  // 16 equations for each of 5 features: 80 samples, so 5 shares.
  const auto on_share = [&](long k) {
    ReducedObjective reduced = Reduced(model, &data);
    VectorXd weights = start;
    std::string error;
    ReducedObjective::Blocks share;
    EXPECT_TRUE(reduced.TrainingShare(k, &share, &error)) << error;
    EXPECT_TRUE(reduced.SolveOnShare(share, true, &weights, &error)) << error;
    return weights;
  };
  EXPECT_EQ(on_share(0), on_share(5));
  EXPECT_NE(on_share(0), on_share(1));
}

TEST(ReducedObjective, FeaturesThatAreNotFiniteFail) {
  const Model model = MakeChain(LinearPhysics());
  const DataSet data = RandomSamples();
  for (const bool of_batch : {true, false}) {
    ReducedObjective reduced = Reduced(model, of_batch ? nullptr : &data);
    VectorXd weights = RandomMatrix(model.num_weights(), 1, 31);
    weights[0] = std::numeric_limits<double>::quiet_NaN();
    const VectorXd before = weights.tail(10);
    std::string error;
    EXPECT_FALSE(reduced.SolveOutputLayer(data, &weights, &error));
    EXPECT_NE(error, "");
    EXPECT_EQ(weights.tail(10), before);
  }
}

// H* is the Hessian of the reduced loss, also away from a small residual.
TEST(ReducedObjective, TheHessianIsThatOfDifferences) {
  const Model model = MakeChain(LinearPhysics());
  const DataSet data = RandomSamples();
  ReducedObjective reduced = Reduced(model);
  const VectorXd weights =
      Solved(model, &reduced, data, RandomMatrix(model.num_weights(), 1, 32));
  LinearizationParts parts;
  parts.gradient = true;
  parts.hessian = true;
  const auto gradient_after = [&](const VectorXd& step, MatrixXd* hessian) {
    VectorXd moved = weights;
    reduced.AddStep(step, &moved);
    moved = Solved(model, &reduced, data, moved);
    Linearization at;
    std::string error;
    EXPECT_TRUE(reduced.Linearize(moved, data, parts, &at, &error)) << error;
    if (hessian != nullptr) *hessian = at.hessian;
    return at.gradient;
  };
  const auto n = reduced.Unknowns(weights).size();
  MatrixXd hessian;
  gradient_after(VectorXd::Zero(n), &hessian);
  constexpr double kStep = 1e-4;
  for (int i = 0; i < n; ++i) {
    const VectorXd step = kStep * VectorXd::Unit(n, i);
    const VectorXd column =
        (gradient_after(step, nullptr) - gradient_after(-step, nullptr)) /
        (2.0 * kStep);
    EXPECT_LT((hessian.col(i) - column).norm(), 1e-6 * (1.0 + hessian.norm()));
  }
}

}  // namespace reduced_objective_test
}  // namespace invgrad
