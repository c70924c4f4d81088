#include "invgrad/inverse/simulator_pull_back.h"

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
#include "tests/support/make_simulator.h"
#include "tests/support/without_hessian.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;
using ConstVectorRef = InverseSimulator::ConstVectorRef;
using Result = SimulatorPullBack::Result;

const double kNan = std::numeric_limits<double>::quiet_NaN();

constexpr SimulatorWay kAllWays[] = {SimulatorWay::kAdjoint,
                                     SimulatorWay::kInverseGradient,
                                     SimulatorWay::kHalfInverse,
                                     SimulatorWay::kInverse};

// y = (exp x0, x1 + x0^2), for x0 < 5 only; x = (log y0, y1 - log^2 y0).
struct Bend {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::exp;
    if (!(x[0] < T(5.0))) return false;
    y[0] = exp(x[0]);
    y[1] = x[1] + x[0] * x[0];
    return true;
  }
};

Vector2d BendInverse(const ConstVectorRef& y) {
  const double x0 = std::log(y[0]);
  return {x0, y[1] - x0 * x0};
}

// Another map in front: x = A(u) = (2 u0, u1 + u0^3), and Q = Bend o A.
struct BendOfCubic {
  template <typename T>
  bool operator()(const T* u, T* y) const {
    const T x[] = {2.0 * u[0], u[1] + u[0] * u[0] * u[0]};
    return Bend()(x, y);
  }
};

Vector2d CubicInverse(const Vector2d& x) {
  const double u0 = 0.5 * x[0];
  return {u0, x[1] - u0 * u0 * u0};
}

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

// Always right.
std::shared_ptr<const InverseSimulator> ExactBendInverse() {
  return Inverse([](const auto& y, const auto& /*x_now*/) {
    return VectorXd(BendInverse(y));
  });
}

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

SimulatorPullBack::Options Way(SimulatorWay way, double truncation = 1e-5) {
  SimulatorPullBack::Options options;
  options.way = way;
  options.truncation = truncation;
  return options;
}

struct Pulled {
  VectorXd y;
  VectorXd d_x;
  Result result;
};

// Pulls d_y back; fails the test if that is not possible.
Pulled Pull(const SimulatorPullBack& pull_back,
            const VectorXd& x,
            const VectorXd& d_y) {
  Pulled pulled;
  pulled.y = VectorXd::Constant(d_y.size(), kNan);
  pulled.d_x = VectorXd::Constant(x.size(), kNan);
  pulled.result.why = "untouched";
  const Simulator::Covector wanted_change = [&](const double* y,
                                                double* change) {
    EXPECT_TRUE(AllFinite(y, d_y.size()));
    Eigen::Map<VectorXd>(change, d_y.size()) = d_y;
    return true;
  };
  EXPECT_TRUE(pull_back(x,
                        VectorXd(),
                        wanted_change,
                        pulled.y.data(),
                        pulled.d_x,
                        &pulled.result));
  VectorXd y(d_y.size());
  EXPECT_TRUE(
      pull_back.simulator().Evaluate(x.data(), nullptr, y.data(), nullptr));
  EXPECT_EQ(pulled.y, y);
  return pulled;
}

bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

// --- Derivatives ---

// J of Bend.
MatrixXd BendJacobian(const Vector2d& x) {
  return (MatrixXd(2, 2) << std::exp(x[0]), 0.0, 2.0 * x[0], 1.0).finished();
}

TEST(SimulatorPullBackTest, AdjointIsTheTransposedJacobian) {
  const Vector2d x(0.4, -1.0);
  const Vector2d d_y(0.3, -2.0);
  const SimulatorPullBack pull_back(
      MakeSimulator<2, 2>(Bend()), nullptr, Way(SimulatorWay::kAdjoint));
  const Pulled pulled = Pull(pull_back, x, d_y);
  EXPECT_LT((pulled.d_x - BendJacobian(x).transpose() * d_y).norm(), 1e-15);
  EXPECT_EQ(pulled.result.source, PullBackSource::kDerivative);
  EXPECT_EQ(pulled.result.why, "");
}

// I - 2 v v^T / |v|^2, orthogonal.
MatrixXd Reflection(const VectorXd& v) {
  return MatrixXd::Identity(v.size(), v.size()) -
         2.0 / v.squaredNorm() * v * v.transpose();
}

// A = U diag(4, 1, 1e-3) V^T, tall and wide: V s^-kappa U^T of what is kept.
TEST(SimulatorPullBackTest, GradientsAreTruncatedPowersOfTheJacobian) {
  const MatrixXd U = Reflection(VectorXd::LinSpaced(5, -1.0, 2.0)).leftCols(3);
  const MatrixXd V = Reflection(VectorXd::LinSpaced(3, 1.0, 2.0));
  const Eigen::Vector3d s(4.0, 1.0, 1e-3);
  const MatrixXd A = U * s.asDiagonal() * V.transpose();
  for (const bool is_wide : {false, true}) {
    const MatrixXd& left = is_wide ? V : U;
    const MatrixXd& right = is_wide ? U : V;
    const auto simulator = MakeLinear(is_wide ? MatrixXd(A.transpose()) : A);
    const VectorXd d_y =
        VectorXd::LinSpaced(simulator->num_outputs(), -1.0, 2.0);
    const VectorXd x = VectorXd::Ones(simulator->num_inputs());
    const struct {
      double truncation;
      int rank;
    } cases[] = {{0.0, 3}, {2e-4, 3}, {3e-4, 2}, {0.24, 2}, {0.26, 1}};
    for (const auto& c : cases) {
      for (const double kappa : {0.5, 1.0}) {
        VectorXd powers = VectorXd::Zero(3);
        powers.head(c.rank) = s.head(c.rank).array().pow(-kappa);
        const VectorXd expected =
            right * powers.asDiagonal() * left.transpose() * d_y;
        const SimulatorWay way = kappa == 1.0 ? SimulatorWay::kInverseGradient
                                              : SimulatorWay::kHalfInverse;
        const SimulatorPullBack pull_back(
            simulator, nullptr, Way(way, c.truncation));
        // The rounding of 1e-3 in a matrix of norm 4: 1e-12 of the result.
        EXPECT_LT((Pull(pull_back, x, d_y).d_x - expected).norm(),
                  1e-11 * expected.norm());
      }
    }
  }
}

// Powers of two, so that s = tau s_max is met exactly.
TEST(SimulatorPullBackTest, ASingularValueAtTheThresholdIsDropped) {
  const auto simulator =
      MakeLinear(Eigen::Vector3d(4.0, 1.0, 0.5).asDiagonal());
  const VectorXd ones = VectorXd::Ones(3);
  const auto pulled = [&](SimulatorWay way, double truncation) {
    return Pull(SimulatorPullBack(simulator, nullptr, Way(way, truncation)),
                ones,
                ones)
        .d_x;
  };
  const SimulatorWay inverse = SimulatorWay::kInverseGradient;
  const SimulatorWay half = SimulatorWay::kHalfInverse;
  EXPECT_LT((pulled(inverse, 0.24) - Eigen::Vector3d(0.25, 1, 0)).norm(),
            1e-15);
  EXPECT_LT((pulled(inverse, 0.25) - Eigen::Vector3d(0.25, 0, 0)).norm(),
            1e-15);
  EXPECT_LT(
      (pulled(half, 0.124) - Eigen::Vector3d(0.5, 1, std::sqrt(2.0))).norm(),
      1e-15);
  EXPECT_LT((pulled(half, 0.125) - Eigen::Vector3d(0.5, 1, 0)).norm(), 1e-15);
}

TEST(SimulatorPullBackTest,
     ExactZeroSingularValuesAreDroppedWithoutTruncation) {
  const VectorXd x = Vector2d::Ones();
  const VectorXd d_y = Vector2d(3.0, 5.0);
  for (const SimulatorWay way :
       {SimulatorWay::kInverseGradient, SimulatorWay::kHalfInverse}) {
    const SimulatorPullBack deficient(
        MakeLinear(Vector2d(4.0, 0.0).asDiagonal()), nullptr, Way(way, 0.0));
    const double factor = way == SimulatorWay::kHalfInverse ? 0.5 : 0.25;
    EXPECT_LT((Pull(deficient, x, d_y).d_x - Vector2d(3.0 * factor, 0)).norm(),
              1e-15);
    const SimulatorPullBack zero(
        MakeLinear(MatrixXd::Zero(2, 2)), nullptr, Way(way, 0.0));
    EXPECT_EQ(Pull(zero, x, d_y).d_x, Vector2d::Zero());
  }
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

// --- Failure ---

TEST(SimulatorPullBackTest, FailsWithoutAValueOrAWantedChange) {
  const auto simulator = MakeSimulator<2, 2>(Bend());
  const Simulator::Covector wanted_change = [](const double*, double* change) {
    change[0] = change[1] = 1.0;
    return true;
  };
  const Simulator::Covector none = [](const double*, double*) { return false; };
  for (const SimulatorWay way : kAllWays) {
    const SimulatorPullBack pull_back(simulator, ExactBendInverse(), Way(way));
    Vector2d y;
    VectorXd d_x(2);
    Result result;
    const Vector2d outside(6.0, 0.0);
    const Vector2d inside(0.4, -1.0);
    EXPECT_FALSE(
        pull_back(outside, VectorXd(), wanted_change, y.data(), d_x, &result));
    EXPECT_FALSE(pull_back(inside, VectorXd(), none, y.data(), d_x, &result));
    EXPECT_TRUE(
        pull_back(inside, VectorXd(), wanted_change, y.data(), d_x, &result));
  }
}

TEST(SimulatorPullBackDeathTest, RefusesWhatMakesNoSense) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const auto simulator = MakeSimulator<2, 2>(Bend());
  SimulatorPullBack::Options options;
  EXPECT_DEATH(SimulatorPullBack(nullptr, nullptr, options), "simulator");
  options.truncation = -0.1;
  EXPECT_DEATH(SimulatorPullBack(simulator, nullptr, options), "truncation");
  options = SimulatorPullBack::Options();
  options.round_trip = 0.0;
  EXPECT_DEATH(SimulatorPullBack(simulator, nullptr, options), "round_trip");
}

// --- Properties of physical gradients ---

// With x(t) = P^-1(y + t d_y), dx/dt = J(x(t))^-1 d_y: the step is the mean of
// the inverse gradients along the path, and not that at its start.
TEST(PhysicalGradientTest, IsTheMeanOfTheInverseGradientsAlongItsPath) {
  const auto simulator = MakeSimulator<2, 2>(Bend());
  const Vector2d x(0.2, 0.5);
  const Vector2d d_y(1.5, -0.7);
  const Pulled physical =
      Pull(SimulatorPullBack(
               simulator, ExactBendInverse(), SimulatorPullBack::Options()),
           x,
           d_y);
  ASSERT_EQ(physical.result.source, PullBackSource::kInverse);
  const SimulatorPullBack inverse_gradient(
      simulator, nullptr, Way(SimulatorWay::kInverseGradient));
  const auto local = [&](double t) {
    const VectorXd at = BendInverse(physical.y + t * d_y);
    return Pull(inverse_gradient, at, d_y).d_x;
  };
  // The midpoint rule, whose error falls with the square of the intervals.
  const auto error = [&](int num_intervals) {
    VectorXd mean = VectorXd::Zero(2);
    for (int k = 0; k < num_intervals; ++k) {
      mean += local((k + 0.5) / num_intervals) / num_intervals;
    }
    return (mean - physical.d_x).norm();
  };
  double last = error(16);
  for (const int num_intervals : {32, 64, 128}) {
    const double next = error(num_intervals);
    EXPECT_NEAR(last / next, 4.0, 0.05);
    last = next;
  }
  EXPECT_LT(last, 1e-4);
  EXPECT_GT((local(0.0) - physical.d_x).norm(), 0.3);
}

Vector2d Moved(const Simulator& simulator,
               const Vector2d& x,
               const VectorXd& d_x) {
  const Vector2d moved = x + d_x;
  Vector2d before;
  Vector2d after;
  EXPECT_TRUE(simulator.Evaluate(x.data(), nullptr, before.data(), nullptr));
  EXPECT_TRUE(simulator.Evaluate(moved.data(), nullptr, after.data(), nullptr));
  return after - before;
}

// P alone, and behind another map A: the change of y that a step causes depends
// on A for gradient descent and for Newton's method in x, and not for physical
// gradients.
TEST(PhysicalGradientTest, TheStepInYDoesNotDependOnWhatStandsBefore) {
  const auto P = MakeSimulator<2, 2>(Bend());
  const auto Q = MakeSimulator<2, 2>(BendOfCubic());
  const Vector2d x(0.2, 0.5);
  const Vector2d u = CubicInverse(x);
  const Vector2d d_y(1.5, -0.7);
  const auto inverse_of_q = Inverse([](const auto& y, const auto& /*x_now*/) {
    return VectorXd(CubicInverse(BendInverse(y)));
  });
  SimulatorPullBack::Options newton = Way(SimulatorWay::kNewton);
  newton.newton.max_loss_change = 1e9;
  SimulatorPullBack::Options numerical;
  numerical.round_trip = 1e-8;

  const auto change = [&](const std::shared_ptr<const Simulator>& simulator,
                          std::shared_ptr<const InverseSimulator> inverse,
                          const SimulatorPullBack::Options& options,
                          const Vector2d& from) {
    const SimulatorPullBack pull_back(simulator, std::move(inverse), options);
    return Moved(*simulator, from, Pull(pull_back, from, d_y).d_x);
  };
  const SimulatorPullBack::Options physical;
  EXPECT_LT((change(P, ExactBendInverse(), physical, x) - d_y).norm(), 1e-14);
  EXPECT_LT((change(Q, inverse_of_q, physical, u) - d_y).norm(), 1e-14);
  EXPECT_LT((change(P, nullptr, numerical, x) - d_y).norm(), 1e-7);
  EXPECT_LT((change(Q, nullptr, numerical, u) - d_y).norm(), 1e-7);

  EXPECT_GT(
      (change(P, nullptr, newton, x) - change(Q, nullptr, newton, u)).norm(),
      0.1 * d_y.norm());
  // Of gradient descent even the direction depends on A, to first order in the
  // step: it is that of J J^T d_y.
  const auto direction = [&](const std::shared_ptr<const Simulator>& simulator,
                             const Vector2d& from) {
    const SimulatorPullBack descent(
        simulator, nullptr, Way(SimulatorWay::kAdjoint));
    const VectorXd small = 1e-6 * Pull(descent, from, d_y).d_x;
    return Vector2d(Moved(*simulator, from, small).normalized());
  };
  EXPECT_GT((direction(P, x) - direction(Q, u)).norm(), 0.1);
  EXPECT_LT((direction(P, x) -
             Vector2d(BendJacobian(x) * BendJacobian(x).transpose() * d_y)
                 .normalized())
                .norm(),
            1e-4);
}

}  // namespace
}  // namespace invgrad
