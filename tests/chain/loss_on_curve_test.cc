#include "invgrad/chain/loss_on_curve.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/field_simulator.h"
#include "invgrad/model.h"
#include "tests/support/random_matrix.h"
#include "tests/support/real_infidelity.h"

namespace invgrad {
namespace loss_on_curve_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kScale = 0.25;

MatrixXd States(int num_samples, int seed) {
  return RandomMatrix(3, num_samples, seed).colwise().normalized();
}

TEST(LossOnCurve, IsTheSumOverTheSamples) {
  constexpr int kNumSamples = 4;
  const auto loss = std::make_shared<RealInfidelity<3>>();
  const MatrixXd y = States(kNumSamples, 1);
  const MatrixXd targets = States(kNumSamples, 2);
  MatrixXd t = RandomMatrix(3, kNumSamples, 3);
  t.col(2).setZero();  // a sample that does not move
  const auto curve = MakeLossOnCurve(loss, y, targets, kScale);
  for (const double eta : {0.0, 1e-6, 0.4, 3.0}) {
    SCOPED_TRACE(eta);
    double expected = 0.0;
    double speed = 0.0;
    for (int s = 0; s < kNumSamples; ++s) {
      const VectorXd p = t.col(s) - y.col(s).dot(t.col(s)) * y.col(s);
      const double length = p.norm();
      const VectorXd direction = length > 0.0 ? VectorXd(p / length) : p;
      const double overlap =
          targets.col(s).dot(std::cos(eta * length) * y.col(s) +
                             std::sin(eta * length) * direction);
      expected += kScale * (1.0 - overlap * overlap);
      speed = std::max(speed, length);
    }
    const LossOnCurve at = curve(t.reshaped(), eta);
    EXPECT_NEAR(at.loss, expected, 1e-14);
    EXPECT_NEAR(at.speed, speed, 1e-13);
    constexpr double kStep = 1e-5;
    const double slope = (curve(t.reshaped(), eta + kStep).loss -
                          curve(t.reshaped(), eta - kStep).loss) /
                         (2.0 * kStep);
    EXPECT_NEAR(at.slope, slope, 1e-9);
  }
}

TEST(LossOnCurve, IsNotANumberIfOneSampleHasNoLoss) {
  const auto loss = std::make_shared<RealInfidelity<3>>();
  MatrixXd targets = States(3, 2);
  targets(1, 1) = std::numeric_limits<double>::quiet_NaN();
  const LossOnCurve at = MakeLossOnCurve(loss, States(3, 1), targets, kScale)(
      VectorXd::Ones(9), 0.1);
  EXPECT_TRUE(std::isnan(at.loss));
  EXPECT_TRUE(std::isnan(at.slope));
}

TEST(LossOnCurveDeathTest, WantsOneDirectionForAllSamples) {
  const auto curve = MakeLossOnCurve(std::make_shared<RealInfidelity<3>>(),
                                     States(3, 1),
                                     States(3, 2),
                                     kScale);
  EXPECT_DEATH(curve(VectorXd::Ones(3), 0.1), "size");
}

// y = (cos x0 cos x1, sin x0 cos x1, sin x1), a point of the sphere.
struct Sphere {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::cos;
    using std::sin;
    y[0] = cos(x[0]) * cos(x[1]);
    y[1] = sin(x[0]) * cos(x[1]);
    y[2] = sin(x[1]);
    return true;
  }
};

using SphereSimulator = AutoDiffSimulator<Sphere, 2, 3>;

// The same, by products.
class SphereField final : public FieldSimulator {
 public:
  int num_inputs() const override { return 2; }
  int num_outputs() const override { return 3; }
  bool Value(const double* x, const double* context, double* y) const override {
    return sphere_.Evaluate(x, context, y, nullptr);
  }
  std::unique_ptr<const JacobianOperator> Linearize(const double* x,
                                                    const double* context,
                                                    double* y) const override {
    return sphere_.Linearize(x, context, y);
  }

 private:
  SphereSimulator sphere_;
};

// Both with the factors of J and with its products.
TEST(LossOnCurve, OfAModelBelongsToLossesWithAnInvariant) {
  DataSet data;
  data.inputs = RandomMatrix(2, 5, 4);
  data.contexts.resize(0, 5);
  data.targets = States(5, 5);
  const DenseNetwork network({2, 4, 2}, Activation::kTanh);
  const VectorXd weights = RandomMatrix(network.num_weights(), 1, 6);
  const std::shared_ptr<const Simulator> simulators[] = {
      std::make_shared<SphereSimulator>(), std::make_shared<SphereField>()};
  for (const auto& simulator : simulators) {
    Linearization at;
    std::string error;
    const Model model(network,
                      simulator,
                      std::make_shared<RealInfidelity<3>>(),
                      Reduction::kMean);
    ASSERT_TRUE(model.Linearize(
        weights, data, LinearizationParts::Jacobian(), &at, &error))
        << error;
    ASSERT_NE(at.loss_on_curve, nullptr);
    const VectorXd d = RandomMatrix(network.num_weights(), 1, 7);
    VectorXd t;
    at.jacobian->Times(d, &t);
    const LossOnCurve start = at.loss_on_curve(t, 0.0);
    EXPECT_NEAR(start.loss, at.cost, 1e-15);
    EXPECT_NEAR(start.slope, at.loss_gradient.dot(t), 1e-13);
    // The outputs of the model leave the curve in second order. Along the curve
    // they turn by the lengths of their derivatives.
    EXPECT_NEAR(
        start.speed, t.reshaped(3, 5).colwise().norm().maxCoeff(), 1e-13);
    constexpr double kStep = 1e-3;
    double cost = 0.0;
    ASSERT_TRUE(model.Cost(weights + kStep * d, data, &cost, &error));
    EXPECT_NEAR(at.loss_on_curve(t, kStep).loss, cost, 1e-4);
    // A loss without one has none, whatever was there before.
    const Model squares(network,
                        simulator,
                        std::make_shared<SquaredNormLoss>(3, 0.5),
                        Reduction::kMean);
    ASSERT_TRUE(squares.Linearize(
        weights, data, LinearizationParts::Jacobian(), &at, &error))
        << error;
    EXPECT_EQ(at.loss_on_curve, nullptr);
  }
}

}  // namespace loss_on_curve_test
}  // namespace invgrad
