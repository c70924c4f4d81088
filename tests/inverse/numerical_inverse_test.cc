#include "invgrad/inverse/numerical_inverse.h"

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "Eigen/Core"
#include "Eigen/LU"
#include "gtest/gtest.h"
#include "invgrad/linear_simulator.h"
#include "invgrad/time_stepping_simulator.h"
#include "tests/support/make_simulator.h"

namespace invgrad {
namespace numerical_inverse_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

const double kNan = std::numeric_limits<double>::quiet_NaN();

// y = (x0, x1^2).
struct Squared {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = x[0];
    y[1] = x[1] * x[1];
    return true;
  }
};

// y = (sin(x0) / 8, 8 x1).
struct Sine {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::sin;
    y[0] = sin(x[0]) / 8.0;
    y[1] = 8.0 * x[1];
    return true;
  }
};

// y = (cos x, sin x): a curve in the plane.
struct Circle {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::cos;
    using std::sin;
    y[0] = cos(x[0]);
    y[1] = sin(x[0]);
    return true;
  }
};

// y = x0^2 + 2 x1^2 + 3 x2^2.
struct Ellipsoid {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = x[0] * x[0] + 2.0 * x[1] * x[1] + 3.0 * x[2] * x[2];
    return true;
  }
};

// y' = D_y^-1 P(D_x x') for P = (x0 + x1^3, exp(x1) - x0): units of x and y.
struct Scaled {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::exp;
    const T x0 = x[0] * x_units[0];
    const T x1 = x[1] * x_units[1];
    y[0] = (x0 + x1 * x1 * x1) / y_units[0];
    y[1] = (exp(x1) - x0) / y_units[1];
    return true;
  }
  Vector2d x_units = Vector2d::Ones();
  Vector2d y_units = Vector2d::Ones();
};

// y = log x, known for 0 < x < 100 only.
struct Logarithm {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::log;
    if (!(x[0] > T(0.0)) || !(x[0] < T(100.0))) return false;
    y[0] = log(x[0]);
    return true;
  }
};

// An oscillator with a cubic spring, semi-implicit Euler.
struct OscillatorStep {
  template <typename T>
  bool operator()(const T* s, const T* u, T* next) const {
    next[1] = s[1] + 0.2 * (u[0] - s[0] - 0.3 * s[0] * s[0] * s[0]);
    next[0] = s[0] + 0.2 * next[1];
    return true;
  }
};

VectorXd Forward(const Simulator& simulator,
                 const VectorXd& x,
                 const VectorXd& context = VectorXd()) {
  VectorXd y(simulator.num_outputs());
  EXPECT_TRUE(simulator.Evaluate(x.data(), context.data(), y.data(), nullptr));
  return y;
}

constexpr double kTolerance = 1e-9;

NumericalInverse MakeInverse(std::shared_ptr<const Simulator> simulator) {
  NumericalInverse::Options options;
  options.tolerance = kTolerance;
  return NumericalInverse(std::move(simulator), options);
}

// P^-1(y; x0); fails the test if there is none.
VectorXd Inverted(const std::shared_ptr<const Simulator>& simulator,
                  const VectorXd& y,
                  const VectorXd& x0,
                  const VectorXd& context = VectorXd()) {
  const NumericalInverse inverse = MakeInverse(simulator);
  VectorXd x;
  std::string why = "untouched";
  EXPECT_TRUE(inverse.Invert(y, x0, context, &x, &why)) << why;
  EXPECT_EQ(why, "untouched");
  const double wanted = (Forward(*simulator, x0, context) - y).norm();
  EXPECT_LE((Forward(*simulator, x, context) - y).norm(), kTolerance * wanted);
  return x;
}

TEST(NumericalInverseTest, PromisesToReachTheTarget) {
  EXPECT_TRUE(MakeInverse(MakeSimulator<2, 2>(Squared())).reaches_target());
}

// Both roots of x1^2 are there: the one on the side of x_0 is wanted.
TEST(NumericalInverseTest, FindsTheRootOnTheSideOfTheStart) {
  const auto simulator = MakeSimulator<2, 2>(Squared());
  for (const double side : {-1.0, 1.0}) {
    for (const double start : {0.3, 1.0, 10.0}) {
      const VectorXd x =
          Inverted(simulator, Vector2d(-3.0, 4.0), Vector2d(1.0, side * start));
      EXPECT_LT((x - Vector2d(-3.0, side * 2.0)).norm(), 1e-7);
    }
  }
}

// The sine has infinitely many pre-images; on the branch of x_0 it is inverted
// by arcsin.
TEST(NumericalInverseTest, FindsTheBranchOfTheStart) {
  const auto simulator = MakeSimulator<2, 2>(Sine());
  const double pi = std::acos(-1.0);
  const double wanted = std::asin(0.6);
  const Vector2d y(0.6 / 8.0, 0.8);
  const struct {
    double start;
    double expected;
  } cases[] = {{0.2, wanted},
               {pi - 0.2, pi - wanted},
               {2.0 * pi + 0.2, 2.0 * pi + wanted},
               {-pi - 0.4, -pi - wanted}};
  for (const auto& c : cases) {
    const VectorXd x = Inverted(simulator, y, Vector2d(c.start, -0.3));
    EXPECT_LT((x - Vector2d(c.expected, 0.1)).norm(), 1e-7);
  }
}

TEST(NumericalInverseTest, ReachesOneOutputWithThreeInputs) {
  const auto simulator = MakeSimulator<3, 1>(Ellipsoid());
  const Vector3d x0(1.0, -0.5, 0.2);
  for (const double y : {0.01, 3.0, 1e4}) {
    Inverted(simulator, VectorXd::Constant(1, y), x0);
  }
}

// Of all solutions of A x = y the one closest to x_0 is x_0 + A^+ (y - A x_0),
// A^+ = A^T (A A^T)^-1.
TEST(NumericalInverseTest, MovesInTheRowSpaceOfALinearSimulator) {
  MatrixXd wide(2, 3);
  wide << 1.0, 2.0, -0.5, 0.3, -1.0, 2.0;
  const MatrixXd row = Vector3d(3.0, -1.0, 0.5).transpose();
  const Vector3d x0(0.7, -0.2, 5.0);
  for (const MatrixXd& A : {wide, row}) {
    const VectorXd y = VectorXd::LinSpaced(A.rows(), 1.0, -2.0);
    const VectorXd expected =
        A.transpose() * (A * A.transpose()).inverse() * (y - A * x0);
    const VectorXd moved = Inverted(MakeLinear(A), y, x0) - x0;
    EXPECT_LT((moved - expected).norm(), 10.0 * kTolerance * expected.norm());
  }
}

// x comes out the same in other units: of both entries, and of one of them as
// far as one damping for all directions of x, and one norm for all of y, allow.
TEST(NumericalInverseTest, TakesIllScaledUnits) {
  const Vector2d start(0.3, 0.2);
  const Vector2d solution(-0.4, 0.9);
  const auto error = [&](const Scaled& scaled) {
    const auto simulator = MakeSimulator<2, 2>(scaled);
    const VectorXd y =
        Forward(*simulator, solution.cwiseQuotient(scaled.x_units));
    const VectorXd x =
        Inverted(simulator, y, start.cwiseQuotient(scaled.x_units));
    return (x.cwiseProduct(scaled.x_units) - solution).norm();
  };
  for (const double unit : {1e-6, 1.0, 1e6}) {
    for (const Vector2d& x_units :
         {Vector2d(unit, unit), Vector2d(unit, 1.0), Vector2d(1.0, unit)}) {
      Scaled scaled;
      scaled.x_units = x_units;
      EXPECT_LT(error(scaled), 10.0 * kTolerance) << x_units.transpose();
    }
    Scaled scaled;
    scaled.y_units = Vector2d(unit, unit);
    EXPECT_LT(error(scaled), 10.0 * kTolerance) << unit;
  }
  // The tolerance is that of |y|: an output in a unit thirty times larger
  // than the other's counts thirty times less.
  for (const Vector2d& y_units : {Vector2d(30.0, 1.0), Vector2d(1.0, 30.0)}) {
    Scaled scaled;
    scaled.y_units = y_units;
    EXPECT_LT(error(scaled), 300.0 * kTolerance) << y_units.transpose();
  }
}

TEST(NumericalInverseTest, InvertsAnOscillatorForTheContextGiven) {
  constexpr int kNumSteps = 8;
  const auto simulator =
      std::make_shared<TimeSteppingSimulator<OscillatorStep>>(
          OscillatorStep(), 2, 1, kNumSteps);
  const VectorXd x0 = VectorXd::LinSpaced(kNumSteps, -0.5, 0.5);
  const Vector2d y(0.8, -0.3);
  std::vector<VectorXd> solutions;
  for (const Vector2d& start : {Vector2d(1.0, 0.0), Vector2d(-0.4, 0.7)}) {
    solutions.push_back(Inverted(simulator, y, x0, start));
  }
  EXPECT_GT((solutions[0] - solutions[1]).norm(), 0.1);
}

// Of a circle's points, that nearest to a y outside or inside is y / |y|.
TEST(NumericalInverseTest, OutOfRangeItComesAsNearAsItCan) {
  const auto simulator = MakeSimulator<1, 2>(Circle());
  const NumericalInverse inverse = MakeInverse(simulator);
  for (const double radius : {0.8, 1.5, 3.0}) {
    const Vector2d y = radius * Vector2d(std::cos(0.7), std::sin(0.7));
    VectorXd x;
    std::string why;
    EXPECT_FALSE(inverse.Invert(y, VectorXd::Zero(1), VectorXd(), &x, &why));
    ASSERT_EQ(x.size(), 1);
    EXPECT_NEAR(x[0], 0.7, 1e-4);
    EXPECT_NE(why.find("% of the way"), std::string::npos) << why;
    EXPECT_NE(why.find("iterations"), std::string::npos) << why;
  }
}

TEST(NumericalInverseTest, OutOfRangeOfTheSineItEndsAtTheCrest) {
  const auto simulator = MakeSimulator<2, 2>(Sine());
  const NumericalInverse inverse = MakeInverse(simulator);
  VectorXd x;
  std::string why;
  EXPECT_FALSE(inverse.Invert(
      Vector2d(0.5, 0.8), Vector2d(0.2, 0.0), VectorXd(), &x, &why));
  ASSERT_EQ(x.size(), 2);
  // At the crest P is flat, and so is where x is: what counts is y.
  const VectorXd y = Forward(*simulator, x);
  EXPECT_NEAR(y[0], 1.0 / 8.0, 1e-4);
  EXPECT_NEAR(y[1], 0.8, 1e-6);
}

TEST(NumericalInverseTest, StepsOutOfTheDomainAreTakenBack) {
  const auto simulator = MakeSimulator<1, 1>(Logarithm());
  // From x = 5 Newton's step to log x = log 0.1 ends at -14.6, and that from
  // 0.1 to log 90 at 0.78: then on, again and again.
  for (const double start : {0.1, 1.0, 5.0}) {
    for (const double wanted : {0.1, 2.0, 90.0}) {
      const VectorXd x = Inverted(simulator,
                                  VectorXd::Constant(1, std::log(wanted)),
                                  VectorXd::Constant(1, start));
      EXPECT_NEAR(x[0], wanted, 1e-7 * wanted);
    }
  }
}

TEST(NumericalInverseTest, FailsWithoutAValueAtTheStart) {
  const NumericalInverse inverse =
      MakeInverse(MakeSimulator<1, 1>(Logarithm()));
  VectorXd x;
  std::string why;
  EXPECT_FALSE(inverse.Invert(
      VectorXd::Zero(1), VectorXd::Constant(1, -1.0), VectorXd(), &x, &why));
  EXPECT_EQ(why, "the simulator has no finite value at x_now");
}

TEST(NumericalInverseTest, ZeroWantedChangeLeavesTheStart) {
  const auto simulator = MakeSimulator<2, 2>(Sine());
  const Vector2d x0(0.2, -0.7);
  EXPECT_EQ(Inverted(simulator, Forward(*simulator, x0), x0), x0);
}

// Small changes are as exact, relative to themselves, as large ones.
TEST(NumericalInverseTest, ToleranceIsRelativeToTheWantedChange) {
  const auto simulator = MakeSimulator<1, 1>(Logarithm());
  for (const double change : {1e-2, 1e-4, 1e-6}) {
    const VectorXd x =
        Inverted(simulator, VectorXd::Constant(1, change), VectorXd::Ones(1));
    EXPECT_NEAR(x[0] - 1.0, std::expm1(change), 2.0 * kTolerance * change);
  }
}

TEST(NumericalInverseTest, ATargetThatIsNotFiniteIsRefused) {
  const NumericalInverse inverse = MakeInverse(MakeSimulator<2, 2>(Squared()));
  const Vector2d x0(1.0, 2.0);
  for (const double bad : {kNan, HUGE_VAL, -HUGE_VAL}) {
    VectorXd x;
    std::string why;
    EXPECT_FALSE(inverse.Invert(Vector2d(bad, 1.0), x0, VectorXd(), &x, &why));
    EXPECT_EQ(why, "the wanted output is not finite");
    EXPECT_EQ(x, x0);
  }
}

// A linear problem takes two steps, as the first is damped a little.
TEST(NumericalInverseTest, TakesAsManyIterationsAsItMay) {
  const auto simulator = MakeLinear(Vector2d(3.0, -1.0).asDiagonal());
  const Vector2d y(1.0, 1.0);
  const auto distance_after = [&](int num_iterations) {
    NumericalInverse::Options options;
    options.max_num_iterations = num_iterations;
    options.tolerance = 1e-15;
    VectorXd x;
    std::string why;
    NumericalInverse(simulator, options)
        .Invert(y, Vector2d::Zero(), VectorXd(), &x, &why);
    return (Forward(*simulator, x) - y).norm();
  };
  EXPECT_LT(distance_after(1), 1e-2);
  EXPECT_LT(distance_after(2), 1e-6);
  EXPECT_GT(distance_after(1), distance_after(2));
}

TEST(NumericalInverseTest, ThreadsMayShareIt) {
  const auto simulator = MakeSimulator<3, 1>(Ellipsoid());
  const NumericalInverse inverse = MakeInverse(simulator);
  constexpr int kNumSamples = 50;
  MatrixXd results[2];
  std::vector<std::thread> threads;
  for (MatrixXd& result : results) {
    result.resize(3, kNumSamples);
    threads.emplace_back([&] {
      for (int s = 0; s < kNumSamples; ++s) {
        VectorXd x;
        std::string why;
        const Vector3d x0(1.0, 0.02 * s - 0.5, 0.3);
        EXPECT_TRUE(inverse.Invert(
            VectorXd::Constant(1, 0.5 + s), x0, VectorXd(), &x, &why));
        result.col(s) = x;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(results[0], results[1]);
}

TEST(NumericalInverseDeathTest, RefusesWhatMakesNoSense) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  NumericalInverse::Options options;
  options.max_num_iterations = 0;
  const auto simulator = MakeSimulator<2, 2>(Squared());
  EXPECT_DEATH(NumericalInverse(simulator, options), "max_num_iterations");
  options = NumericalInverse::Options();
  options.tolerance = 0.0;
  EXPECT_DEATH(NumericalInverse(simulator, options), "tolerance");
  EXPECT_DEATH(NumericalInverse(nullptr, NumericalInverse::Options()),
               "simulator");
}

}  // namespace numerical_inverse_test
}  // namespace invgrad
