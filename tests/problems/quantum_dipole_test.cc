#include "problems/quantum_dipole.h"

#include <cmath>
#include <complex>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/autodiff_loss.h"
#include "invgrad/loss.h"
#include "invgrad/rules/step_size.h"
#include "problems/problems.h"
#include "tests/support/create_problem.h"

namespace invgrad {
namespace quantum_dipole_test {

using Eigen::VectorXcd;
using Eigen::VectorXd;

constexpr int kSize = SchroedingerSimulator::kStateSize;

VectorXd Es(int n) { return SchroedingerSimulator::Eigenstate(n); }

// exp(i angle) state.
VectorXd Turned(const VectorXd& state, double angle) {
  VectorXd turned(kSize);
  for (int k = 0; k < kSize; k += 2) {
    const auto value =
        std::polar(1.0, angle) * std::complex<double>(state[k], state[k + 1]);
    turned[k] = value.real();
    turned[k + 1] = value.imag();
  }
  return turned;
}

double Loss(const VectorXd& y,
            const VectorXd& target,
            VectorXd* gradient = nullptr) {
  const AutoDiffLoss<Infidelity, kSize> loss;
  double value = 0.0;
  EXPECT_TRUE(loss.Evaluate(y.data(),
                            target.data(),
                            &value,
                            gradient != nullptr ? gradient->data() : nullptr,
                            nullptr));
  return value;
}

TEST(Infidelity, IsZeroForEqualAndOneForOrthogonalStates) {
  EXPECT_NEAR(Loss(Es(2), Es(2)), 0.0, 1e-15);
  EXPECT_NEAR(Loss(Es(1), Es(2)), 1.0, 1e-15);
  // |<es2|cos a es2 + sin a es3>|^2 = cos^2 a
  const double a = 0.7;
  EXPECT_NEAR(Loss(std::cos(a) * Es(2) + std::sin(a) * Es(3), Es(2)),
              std::pow(std::sin(a), 2.0),
              1e-15);
}

TEST(Infidelity, PhasesAreFree) {
  const VectorXd target = VectorXd::Random(kSize).normalized();
  const VectorXd y = VectorXd::LinSpaced(kSize, -1.0, 2.0).normalized();
  const double loss = Loss(y, target);
  EXPECT_GT(loss, 0.1);
  EXPECT_LT(loss, 0.999);
  EXPECT_NEAR(Loss(Turned(y, 1.1), target), loss, 1e-14);
  EXPECT_NEAR(Loss(y, Turned(target, -0.4)), loss, 1e-14);
  EXPECT_NEAR(Loss(target, y), loss, 1e-14);
  EXPECT_NEAR(Loss(Turned(y, 2.0), y), 0.0, 1e-14);
}

// dL/dy = -2 Re, Im of <y*|y> y*.
TEST(Infidelity, GradientIsTheProjectionOnTheTarget) {
  VectorXd gradient(kSize);
  Loss(Es(3), Es(3), &gradient);
  EXPECT_LT((gradient + 2.0 * Es(3)).norm(), 1e-14);
  Loss(Turned(Es(3), 0.5 * M_PI), Es(3), &gradient);
  EXPECT_LT((gradient + 2.0 * Turned(Es(3), 0.5 * M_PI)).norm(), 1e-14);
  Loss(Es(1), Es(3), &gradient);
  EXPECT_LT(gradient.norm(), 1e-14);
}

// y with <y*|y> = overlap exp(i angle), and the rest orthogonal to y* = es(2).
VectorXd WithOverlap(double overlap, double angle) {
  return Turned(overlap * Es(2) + std::sqrt(1.0 - overlap * overlap) * Es(5),
                angle);
}

// |<y*|y cos a + p sin a>|^2 of complex states, by hand.
TEST(InfidelityLoss, TheGreatCircleIsThatOfTheStates) {
  const InfidelityLoss loss;
  EXPECT_TRUE(loss.has_invariant());
  const VectorXd target = Turned(0.6 * Es(2) + 0.8 * Es(3), 0.3);
  const VectorXd y = WithOverlap(0.4, 1.9);
  // With a part along i y, a phase, which is a motion on the sphere, too.
  const VectorXd t =
      VectorXd::LinSpaced(kSize, -1.0, 0.5) + 0.7 * Turned(y, 0.5 * M_PI);
  const auto overlap = [&](const VectorXd& state) {
    std::complex<double> sum = 0.0;
    for (int k = 0; k < kSize; k += 2) {
      sum += std::complex<double>(target[k], -target[k + 1]) *
             std::complex<double>(state[k], state[k + 1]);
    }
    return sum;
  };
  const VectorXd p = t - y.dot(t) * y;
  const double eta = 0.31;
  VectorXd moved(kSize), velocity(kSize);
  loss.Retract(y.data(), t.data(), eta, moved.data(), velocity.data());
  EXPECT_NEAR(moved.norm(), 1.0, 1e-14);
  const double a = eta * p.norm();
  EXPECT_NEAR(Loss(moved, target),
              1.0 - std::norm(std::cos(a) * overlap(y) +
                              std::sin(a) / p.norm() * overlap(p)),
              1e-14);
}

// At first most samples are far from their targets, where the loss curves
// downwards on the sphere, too.
TEST(QuantumDipole, AutomaticStepsEndAtAMinimumOfTheLossOfTheStates) {
  const LearningProblem problem =
      CreateLearningProblem("quantum_dipole:num_samples=16:num_steps=12");
  const Model& model = *problem.model;
  for (const std::uint32_t seed : {1, 2, 3}) {
    SCOPED_TRACE(seed);
    NumpyRandom random(seed);
    const VectorXd weights =
        model.network().InitialWeights(Initialization::kGlorotUniform, &random);
    LinearizationParts parts = LinearizationParts::Jacobian();
    parts.gradient = true;
    Linearization at;
    std::string error;
    ASSERT_TRUE(model.Linearize(weights, problem.train, parts, &at, &error))
        << error;
    const VectorXd d = -at.gradient;
    AlongDirection along;
    double eta = 0.0;
    ASSERT_TRUE(ModelAlong(at, d, &along, &error)) << error;
    EXPECT_NEAR(along.slope * along.unit / -d.squaredNorm(), 1.0, 1e-9);
    ASSERT_TRUE(AutoStepSize(along, 1.0, &eta, &error)) << error;
    VectorXd t;
    at.jacobian->Times(d, &t);
    Eigen::MatrixXd y;
    ASSERT_TRUE(model.Predict(weights, problem.train, &y, &error)) << error;
    // The states turned by hand, sample by sample.
    const auto loss = [&](double part) {
      double sum = 0.0;
      for (int s = 0; s < 16; ++s) {
        const VectorXd t_s = t.segment(s * kSize, kSize);
        const double a = part * eta * t_s.norm();
        sum += Loss(std::cos(a) * y.col(s) + std::sin(a) * t_s.normalized(),
                    problem.train.targets.col(s));
      }
      return sum / 16.0;
    };
    EXPECT_NEAR(loss(0.0), at.cost, 1e-12);
    for (const double part : {0.0, 0.5, 0.9, 1.1}) {
      EXPECT_GT(loss(part), loss(1.0)) << part;
    }
    EXPECT_NEAR(along.Change(0.3 * eta), loss(0.3) - loss(0.0), 1e-10);
  }
}

TEST(QuantumDipole, HasThePublishedSizes) {
  const LearningProblem problem = CreateLearningProblem("quantum_dipole");
  EXPECT_EQ(problem.model->num_weights(), 9484);
  EXPECT_EQ(problem.model->dense_network()->widths(),
            (std::vector<int>{28, 20, 20, 20, 384}));
  EXPECT_EQ(problem.model->reduction(), Reduction::kMean);
  EXPECT_FALSE(problem.model->loss().SquaredNormFactor().has_value());
  EXPECT_EQ(problem.train.num_samples(), 1024);
  EXPECT_EQ(problem.test.num_samples(), 1024);
  EXPECT_EQ(problem.batch_size, 16);
}

TEST(QuantumDipole, TargetsAreDrawnAsTheReleaseDrawsThem) {
  // import numpy as np; np.random.seed(1)
  // for _ in range(2): np.random.normal(), np.random.normal(),
  //     np.random.uniform(0, 2 * np.pi), np.random.uniform(0, 2 * np.pi)
  const Eigen::Vector2d c[] = {{1.6243453636632417, -0.6117564136500754},
                               {-0.5281717522634557, -1.0729686221561705}};
  const LearningProblem problem = CreateLearningProblem("quantum_dipole");
  for (int s = 0; s < 2; ++s) {
    const VectorXd expected = (c[s][0] * Es(2) + c[s][1] * Es(3)) / c[s].norm();
    EXPECT_LT((problem.train.targets.col(s) - expected).norm(), 1e-15) << s;
  }
}

TEST(QuantumDipole, StatesAreNormalizedAndGoFromTheGroundStateToTheTargets) {
  const LearningProblem problem =
      CreateLearningProblem("quantum_dipole:num_samples=50");
  for (const DataSet* data : {&problem.train, &problem.test}) {
    EXPECT_EQ(data->inputs, data->targets);
    for (int s = 0; s < 50; ++s) {
      const VectorXd target = data->targets.col(s);
      EXPECT_NEAR(target.norm(), 1.0, 1e-14);
      EXPECT_NEAR(std::hypot(target.dot(Es(2)), target.dot(Es(3))), 1.0, 1e-14);
      EXPECT_EQ(data->contexts.col(s), Es(1));
    }
  }
  EXPECT_NE(problem.train.targets, problem.test.targets);
  EXPECT_NE(CreateLearningProblem("quantum_dipole:num_samples=50:data_seed=2")
                .train.targets,
            problem.train.targets);
}

TEST(QuantumDipole, BadSettingsAndDataAreRefused) {
  PhysicsProblem problem;
  std::string error;
  for (const char* setting : {"num_steps=0", "dt=0", "num_samples=0"}) {
    EXPECT_FALSE(CreateProblem(
        std::string("quantum_dipole:") + setting, nullptr, &problem, &error));
    EXPECT_NE(error.find(setting), std::string::npos) << error;
  }
  Eigen::MatrixXd data(3, 27);
  EXPECT_FALSE(CreateProblem("quantum_dipole", &data, &problem, &error));
  EXPECT_NE(error.find("(3, 27)"), std::string::npos) << error;
  data = Es(2).transpose().replicate(3, 1);
  EXPECT_TRUE(CreateProblem("quantum_dipole", &data, &problem, &error));
  data.row(1) *= 2.0;
  EXPECT_FALSE(CreateProblem("quantum_dipole", &data, &problem, &error));
  EXPECT_NE(error.find("row 1"), std::string::npos) << error;
}

}  // namespace quantum_dipole_test
}  // namespace invgrad
