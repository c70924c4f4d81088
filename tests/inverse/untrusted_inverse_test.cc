// Inverses under SimulatorPullBack: its test of their answers, and what it falls
// back to.
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/inverse/simulator_pull_back.h"
#include "invgrad/inverse_simulator.h"
#include "tests/inverse/pull_one_back.h"
#include "tests/support/without_hessian.h"

namespace invgrad {
namespace untrusted_inverse_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;
using ConstVectorRef = InverseSimulator::ConstVectorRef;

const double kNan = std::numeric_limits<double>::quiet_NaN();

// y = (sin x0, 2 x1).
struct Sine {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::sin;
    y[0] = sin(x[0]);
    y[1] = 2.0 * x[1];
    return true;
  }
};

// y = x^2.
struct Square {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = x[0] * x[0];
    return true;
  }
};

// Always the same answer.
std::shared_ptr<const InverseSimulator> Answer(const VectorXd& answer) {
  return Inverse(
      [answer](const auto& /*y*/, const auto& /*x_now*/) { return answer; });
}

// Fails with this reason, and with this x.
class Refusal final : public InverseSimulator {
 public:
  explicit Refusal(std::string reason, VectorXd x = VectorXd())
      : reason_(std::move(reason)), x_(std::move(x)) {}
  bool Invert(const ConstVectorRef& /*y*/,
              const ConstVectorRef& /*x_now*/,
              const ConstVectorRef& /*context*/,
              VectorXd* x,
              std::string* why) const override {
    *x = x_;
    *why = reason_;
    return false;
  }

 private:
  std::string reason_;
  VectorXd x_;
};

std::shared_ptr<const InverseSimulator> Refuse(const std::string& reason) {
  return std::make_shared<Refusal>(reason);
}

bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

// --- Given inverses ---

class GivenInverseTest : public testing::Test {
 protected:
  Pulled PullThrough(std::shared_ptr<const InverseSimulator> inverse) const {
    return Pull(
        SimulatorPullBack(simulator_, std::move(inverse), options_), x_, d_y_);
  }

  // The other inverse is used in its place, and the reason given.
  void ExpectRefused(std::shared_ptr<const InverseSimulator> inverse,
                     const std::string& why) const {
    const Pulled pulled = PullThrough(std::move(inverse));
    EXPECT_EQ(pulled.result.source, PullBackSource::kNumericalInverse);
    EXPECT_EQ(pulled.result.why, why);
    // Of order one, to the round trip's tolerance.
    EXPECT_LT((pulled.d_x - Expected()).norm(), 10.0 * options_.round_trip);
  }

  Vector2d Wanted() const {
    return Vector2d(std::exp(x_[0]), x_[1] + x_[0] * x_[0]) + d_y_;
  }
  Vector2d Expected() const { return BendInverse(Wanted()) - x_; }

  const std::shared_ptr<const Simulator> simulator_ =
      MakeSimulator<2, 2>(Bend());
  const Vector2d x_{0.4, -1.0};
  const Vector2d d_y_{0.75, -2.0};
  SimulatorPullBack::Options options_;
};

TEST_F(GivenInverseTest, ARightAnswerIsTaken) {
  const Pulled pulled = PullThrough(ExactBendInverse());
  EXPECT_EQ(pulled.result.source, PullBackSource::kInverse);
  EXPECT_EQ(pulled.result.why, "");
  EXPECT_LT((pulled.d_x - Expected()).norm(), 1e-15);
}

TEST_F(GivenInverseTest, IsGivenWhatItNeeds) {
  const auto inverse = Inverse([&](const auto& y, const auto& x_now) {
    EXPECT_EQ(VectorXd(y), Wanted());
    EXPECT_EQ(VectorXd(x_now), x_);
    return VectorXd(BendInverse(y));
  });
  EXPECT_EQ(PullThrough(inverse).result.source, PullBackSource::kInverse);
}

TEST_F(GivenInverseTest, WithoutOneTheNumericalInverseIsTheFirstChoice) {
  const Pulled pulled = PullThrough(nullptr);
  EXPECT_EQ(pulled.result.source, PullBackSource::kNumericalInverse);
  EXPECT_EQ(pulled.result.why, "");
  EXPECT_LT((pulled.d_x - Expected()).norm(), 10.0 * options_.round_trip);
}

TEST_F(GivenInverseTest, ARefusalIsReported) {
  ExpectRefused(Refuse("no pre-image: y_0 <= 0"), "no pre-image: y_0 <= 0");
  ExpectRefused(
      Inverse([](const auto&, const auto&) -> std::optional<VectorXd> {
        return std::nullopt;
      }),
      "the inverse has no x for y = (2.242, -2.84)");
}

// Otherwise nobody would learn of it.
TEST_F(GivenInverseTest, ARefusalWithoutAReasonIsReportedToo) {
  const Pulled pulled = PullThrough(Refuse(""));
  EXPECT_EQ(pulled.result.source, PullBackSource::kNumericalInverse);
  EXPECT_NE(pulled.result.why, "");
}

template <typename Exception>
std::shared_ptr<const InverseSimulator> Thrower(Exception exception) {
  return Inverse(
      [exception](const auto&, const auto&) -> std::optional<VectorXd> {
        throw exception;
      });
}

TEST_F(GivenInverseTest, ExceptionsAreCaught) {
  ExpectRefused(Thrower(std::runtime_error("table has no row 7")),
                "the inverse threw: table has no row 7");
  ExpectRefused(Thrower(7), "the inverse threw");
}

TEST_F(GivenInverseTest, ValuesThatAreNotFiniteAreRefused) {
  for (const double bad : {kNan, HUGE_VAL, -HUGE_VAL}) {
    ExpectRefused(Answer(Vector2d(0.4, bad)), "the inverse is not finite");
  }
}

TEST_F(GivenInverseTest, AWrongSizeIsRefused) {
  ExpectRefused(Answer(VectorXd::Ones(3)),
                "the inverse returned 3 numbers; the simulator has 2 inputs");
  ExpectRefused(Answer(VectorXd()),
                "the inverse returned 0 numbers; the simulator has 2 inputs");
}

TEST_F(GivenInverseTest, AWrongAnswerIsRefused) {
  // Right in y0, and half of |d_y| off in y1.
  const Vector2d wrong =
      BendInverse(Wanted()) + Vector2d(0.0, 0.5 * d_y_.norm());
  ExpectRefused(Answer(wrong), "round trip: |P(x~) - y~| is 0.500000 |y~ - y|");
}

TEST_F(GivenInverseTest, AnAnswerOutsideTheDomainIsRefused) {
  ExpectRefused(Answer(Vector2d(6.0, 0.0)),
                "round trip: |P(x~) - y~| is inf |y~ - y|");
}

TEST_F(GivenInverseTest, AWrongAnswerThatIsNotPromisedToBeRightIsTaken) {
  class Stroll final : public InverseSimulator {
   public:
    bool Invert(const ConstVectorRef& /*y*/,
                const ConstVectorRef& x0,
                const ConstVectorRef& /*context*/,
                VectorXd* x,
                std::string* /*why*/) const override {
      *x = x0 + VectorXd::Constant(2, 0.25);
      return true;
    }
    bool reaches_target() const override { return false; }
  };
  const Pulled pulled = PullThrough(std::make_shared<Stroll>());
  EXPECT_EQ(pulled.result.source, PullBackSource::kInverse);
  EXPECT_LT((pulled.d_x - Vector2d(0.25, 0.25)).norm(), 1e-15);
  options_.accept_nearer = true;
  EXPECT_EQ(PullThrough(std::make_shared<Stroll>()).result.source,
            PullBackSource::kInverse);
}

TEST_F(GivenInverseTest, ZeroWantedChangeAsksNobody) {
  const auto zero = [&](std::shared_ptr<const InverseSimulator> inverse) {
    return Pull(SimulatorPullBack(simulator_, std::move(inverse), options_),
                x_,
                Vector2d::Zero());
  };
  const Pulled given = zero(Thrower(7));
  EXPECT_EQ(given.d_x, Vector2d::Zero());
  EXPECT_EQ(given.result.source, PullBackSource::kInverse);
  EXPECT_EQ(given.result.why, "");
  const Pulled numerical = zero(nullptr);
  EXPECT_EQ(numerical.d_x, Vector2d::Zero());
  EXPECT_EQ(numerical.result.source, PullBackSource::kNumericalInverse);
}

// Close to the target |d_y| falls below the rounding of P itself: no inverse
// could be better.
TEST_F(GivenInverseTest, RoundingIsNotHeldAgainstAnExactInverse) {
  for (double x0 = -2.0; x0 < 2.0; x0 += 0.1) {
    for (const double share : {1e-9, 1e-12, 1e-14, 1e-16}) {
      const double d_y = share * std::exp(x0);
      const Pulled pulled =
          Pull(SimulatorPullBack(simulator_, ExactBendInverse(), options_),
               Vector2d(x0, 0.0),
               Vector2d(d_y, 0.0));
      EXPECT_EQ(pulled.result.source, PullBackSource::kInverse)
          << share << ": " << pulled.result.why;
    }
  }
}

TEST(SimulatorPullBackTest, TheRoundTripIsHeldToItsToleranceExactly) {
  SimulatorPullBack::Options options;
  options.round_trip = 0.25;
  const auto identity = std::make_shared<IdentitySimulator>(2);
  const Vector2d d_y(1.0, 0.0);
  const auto source = [&](double left) {
    return Pull(SimulatorPullBack(
                    identity, Answer(d_y + Vector2d(0.0, left)), options),
                Vector2d::Zero(),
                d_y)
        .result.source;
  };
  EXPECT_EQ(source(0.25), PullBackSource::kInverse);
  EXPECT_EQ(source(-0.25), PullBackSource::kInverse);
  EXPECT_EQ(source(0.25 + 1e-12), PullBackSource::kNumericalInverse);
}

// --- The chain of fall-backs ---

TEST(FallBackTest, InverseGradientWhereTheTargetIsOutOfRange) {
  const Vector2d x(0.0, 0.5);
  const Vector2d d_y(1.5, 0.3);  // J = diag(1, 2): sin 1.5 is nearer to 1.5
  const SimulatorPullBack pull_back(MakeSimulator<2, 2>(Sine()),
                                    Refuse("|y_0| > 1"),
                                    SimulatorPullBack::Options());
  const Pulled pulled = Pull(pull_back, x, d_y);
  EXPECT_EQ(pulled.result.source, PullBackSource::kInverseGradient);
  EXPECT_LT((pulled.d_x - Vector2d(1.5, 0.15)).norm(), 1e-14);
  EXPECT_TRUE(Contains(pulled.result.why, "|y_0| > 1; the numerical inverse"))
      << pulled.result.why;
}

// From 1.2 the tangent of the sine leads to 3.87, where sin is -0.67.
TEST(FallBackTest, GradientWhereTheInverseGradientLeadsAway) {
  const Vector2d x(1.2, 0.5);
  const Vector2d d_y(1.9 - std::sin(1.2), 0.3);
  const SimulatorPullBack pull_back(
      MakeSimulator<2, 2>(Sine()), nullptr, SimulatorPullBack::Options());
  const Pulled pulled = Pull(pull_back, x, d_y);
  EXPECT_EQ(pulled.result.source, PullBackSource::kGradient);
  const MatrixXd J = Vector2d(std::cos(1.2), 2.0).asDiagonal();
  const VectorXd gradient = J.transpose() * d_y;
  const double t = gradient.squaredNorm() / (J * gradient).squaredNorm();
  EXPECT_LT((pulled.d_x - t * gradient).norm(), 1e-14);
  // It minimizes |J d_x - d_y| along itself.
  EXPECT_NEAR((J * gradient).dot(J * pulled.d_x - d_y), 0.0, 1e-14);
  EXPECT_TRUE(Contains(pulled.result.why, "the numerical inverse came"))
      << pulled.result.why;
}

TEST(FallBackTest, NothingWhereTheJacobianIsZero) {
  const SimulatorPullBack pull_back(
      MakeSimulator<1, 1>(Square()), nullptr, SimulatorPullBack::Options());
  for (const double d_y : {-1.0, 1.0}) {
    const Pulled pulled =
        Pull(pull_back, VectorXd::Zero(1), VectorXd::Constant(1, d_y));
    EXPECT_EQ(pulled.result.source, PullBackSource::kNone);
    EXPECT_EQ(pulled.d_x, VectorXd::Zero(1));
    EXPECT_NE(pulled.result.why, "");
  }
}

TEST(FallBackTest, NothingWhereTheWantedChangeIsNotFinite) {
  const SimulatorPullBack pull_back(
      MakeSimulator<2, 2>(Sine()), nullptr, SimulatorPullBack::Options());
  const Pulled pulled = Pull(pull_back, Vector2d::Ones(), Vector2d(kNan, 0.0));
  EXPECT_EQ(pulled.result.source, PullBackSource::kNone);
  EXPECT_EQ(pulled.d_x, Vector2d::Zero());
  EXPECT_TRUE(Contains(pulled.result.why, "not finite")) << pulled.result.why;
}

// --- accept_nearer ---

SimulatorPullBack::Options AcceptNearer() {
  SimulatorPullBack::Options options;
  options.accept_nearer = true;
  return options;
}

TEST(AcceptNearerTest, TheNumericalInverseMayStopShort) {
  const SimulatorPullBack pull_back(
      MakeSimulator<2, 2>(Sine()), nullptr, AcceptNearer());
  const Vector2d x(1.2, 0.5);
  const Pulled pulled = Pull(pull_back, x, Vector2d(1.9 - std::sin(1.2), 0.3));
  EXPECT_EQ(pulled.result.source, PullBackSource::kNumericalInverse);
  EXPECT_EQ(pulled.result.why, "");
  EXPECT_NEAR(std::sin(x[0] + pulled.d_x[0]), 1.0, 1e-4);
  EXPECT_NEAR(pulled.d_x[1], 0.15, 1e-4);
}

// The nearest point, and false because it is not y.
TEST(AcceptNearerTest, SoMayAGivenInverse) {
  const Vector2d x(1.2, 0.5);
  const Vector2d d_y(1.9 - std::sin(1.2), 0.3);
  const auto nearest =
      std::make_shared<Refusal>("|y_0| > 1", Vector2d(std::asin(1.0), 0.65));
  const auto simulator = MakeSimulator<2, 2>(Sine());
  const Pulled accepted =
      Pull(SimulatorPullBack(simulator, nearest, AcceptNearer()), x, d_y);
  EXPECT_EQ(accepted.result.source, PullBackSource::kInverse);
  EXPECT_EQ(accepted.result.why, "");  // it was taken
  EXPECT_NEAR(accepted.d_x[0], std::asin(1.0) - 1.2, 1e-15);
  const Pulled refused =
      Pull(SimulatorPullBack(simulator, nearest, SimulatorPullBack::Options()),
           x,
           d_y);
  EXPECT_EQ(refused.result.source, PullBackSource::kGradient);
}

TEST(AcceptNearerTest, WhatLeadsAwayIsStillRefused) {
  const auto simulator = MakeSimulator<2, 2>(Sine());
  const Vector2d x(0.0, 0.5);
  const Vector2d d_y(0.5, 0.0);
  const auto source = [&](const Vector2d& answer) {
    return Pull(SimulatorPullBack(simulator, Answer(answer), AcceptNearer()),
                x,
                d_y)
        .result.source;
  };
  EXPECT_EQ(source(Vector2d(0.2, 0.5)), PullBackSource::kInverse);
  EXPECT_EQ(source(Vector2d(-0.2, 0.5)), PullBackSource::kNumericalInverse);
  EXPECT_EQ(source(x), PullBackSource::kNumericalInverse);
}

// A Newton inverse promises nothing, but if it fails it has not come nearer.
TEST(AcceptNearerTest, AFailedNewtonInverseIsRefused) {
  const auto simulator = std::make_shared<WithoutHessian>();
  const Vector2d d_y(0.5, -1.0);
  for (const bool accept_nearer : {false, true}) {
    SimulatorPullBack::Options options = Way(SimulatorWay::kNewton);
    options.accept_nearer = accept_nearer;
    const Pulled pulled = Pull(
        SimulatorPullBack(simulator, nullptr, options), Vector2d::Zero(), d_y);
    EXPECT_EQ(pulled.result.source, PullBackSource::kNumericalInverse);
    EXPECT_EQ(pulled.result.why,
              "the simulator has no finite second derivative");
    EXPECT_LT((pulled.d_x - d_y).norm(), 1e-2);
  }
}

}  // namespace untrusted_inverse_test
}  // namespace invgrad
