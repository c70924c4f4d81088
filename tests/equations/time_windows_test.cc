#include "invgrad/time_windows.h"

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "tests/equations/decay.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/train_options.h"

namespace invgrad {
namespace time_windows_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kRate = 2.0;

Equation Window(const TimeWindow& window) {
  return DecayEquation(kRate, window.begin, window.end, window.start);
}

TEST(TimeWindows, SolveAnEquationContinuously) {
  TrainOptions options;
  options.max_num_steps = 150;
  WindowSolutions solutions;
  std::string error;
  const std::vector<double> times = {0.0, 0.5, 1.0};
  ASSERT_TRUE(SolveInWindows(
      times, DecayStart, Window, "geodesic", options, &solutions, &error))
      << error;
  ASSERT_EQ(solutions.times, times);
  ASSERT_EQ(solutions.weights.size(), 2u);
  const MatrixXd points = GridPoints(kDecayBox, {9, 5});
  MatrixXd u;
  ASSERT_TRUE(solutions.At(points, &u, &error)) << error;
  for (Eigen::Index s = 0; s < points.cols(); ++s) {
    // As well as eight neurons know u.
    EXPECT_NEAR(u(s), DecaySolution(kRate, points.col(s)), 1e-3);
  }
  MatrixXd nowhere(2, 2);
  nowhere << 0.5, std::nan(""), 0.0, 0.0;
  ASSERT_TRUE(solutions.At(nowhere, &u, &error)) << error;
  EXPECT_TRUE(std::isfinite(u(0)));
  EXPECT_TRUE(std::isnan(u(1)));
  // At the seam, also at other x than those of the points.
  MatrixXd seam(2, 3), before, after;
  seam << 0.5, 0.5, 0.5, -0.93, 0.01, 0.77;
  ASSERT_TRUE(Solution(
      solutions.equations[0], solutions.weights[0], seam, &before, &error));
  ASSERT_TRUE(Solution(
      solutions.equations[1], solutions.weights[1], seam, &after, &error));
  EXPECT_LT((before - after).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(TimeWindows, NameTheWindowThatFails) {
  const auto fails_later = [](const TimeWindow& window) {
    Equation equation = Window(window);
    if (window.begin > 0.0) {
      equation.coefficients[0] = std::numeric_limits<double>::infinity();
    }
    return equation;
  };
  TrainOptions options;
  options.max_num_steps = 3;
  WindowSolutions solutions;
  std::string error;
  EXPECT_FALSE(SolveInWindows({0.0, 0.25, 1.0},
                              DecayStart,
                              fails_later,
                              "geodesic",
                              options,
                              &solutions,
                              &error));
  EXPECT_EQ(error.rfind("window 1, t from 0.25 to 1: ", 0), 0u) << error;
  EXPECT_EQ(solutions.weights.size(), 1u);
}

// u_tt = -u. A second window would start at rest.
struct Oscillator {
  template <typename T>
  bool operator()(const T* u, T* y) const {
    y[0] = u[1] + u[0];
    return true;
  }
};

TEST(TimeWindows, RefuseASecondDerivativeInTime) {
  const auto oscillator = [](const TimeWindow& window) {
    Equation equation = Window(window);
    equation.trial.derivatives =
        std::make_shared<DerivativeSet>("tx", std::vector<std::string>{"tt"});
    equation.terms[0].residual =
        std::make_shared<AutoDiffSimulator<Oscillator, 2, 1>>();
    equation.coefficients.resize(0);
    return equation;
  };
  TrainOptions options;
  options.max_num_steps = 3;
  WindowSolutions solutions;
  std::string error;
  const auto solve = [&](const std::vector<double>& times) {
    return SolveInWindows(
        times, DecayStart, oscillator, "geodesic", options, &solutions, &error);
  };
  EXPECT_FALSE(solve({0.0, 0.5, 1.0}));
  EXPECT_EQ(error,
            "the derivative tt: windows hand over the values only; write u_tt "
            "as a system of first order in u and v = u_t");
  EXPECT_TRUE(solutions.weights.empty());
  // One window hands over nothing.
  EXPECT_TRUE(solve({0.0, 1.0})) << error;
}

TEST(TimeWindows, ACallbackThatAbortsEndsAll) {
  StopAt abort(2, ceres::SOLVER_ABORT);
  TrainOptions options;
  options.max_num_steps = 3;
  options.callbacks = {&abort};
  WindowSolutions solutions;
  std::string error;
  EXPECT_FALSE(SolveInWindows({0.0, 0.5, 1.0},
                              DecayStart,
                              Window,
                              "geodesic",
                              options,
                              &solutions,
                              &error));
  EXPECT_EQ(error.rfind("window 0, t from 0 to 0.5: aborted by a callback", 0),
            0u)
      << error;
  EXPECT_TRUE(solutions.weights.empty());
}

TEST(TimeWindows, RefuseOneCheckpointForSeveralWindows) {
  const TemporaryFolder folder;
  TrainOptions options;
  options.max_num_steps = 3;
  options.checkpoint_path = folder / "checkpoint";
  WindowSolutions solutions;
  std::string error;
  const auto solve = [&](const std::vector<double>& times) {
    return SolveInWindows(
        times, DecayStart, Window, "geodesic", options, &solutions, &error);
  };
  EXPECT_FALSE(solve({0.0, 0.5, 1.0}));
  EXPECT_EQ(error,
            "checkpoint_path: a checkpoint is of one window, and these are 2");
  EXPECT_TRUE(solutions.weights.empty());
  EXPECT_TRUE(solve({0.0, 1.0})) << error;
}

// An equation keeps several copies of its start, as those of the problems do.
TEST(TimeWindows, CopiesOfAStartDoNotMultiply) {
  const auto token = std::make_shared<int>();
  const InputFunction start = [token](const InputJet* a, InputJet* u) {
    DecayStart(a, u);
  };
  const auto make_equation = [](const TimeWindow& window) {
    Equation equation = Window(window);
    equation.trial.distance = [window](const InputJet* a, InputJet* d) {
      d[0] = a[0] - window.begin;
    };
    equation.terms[0].points = GaussPoints(
        {Eigen::Vector2d(window.begin, -1.0), Eigen::Vector2d(window.end, 1.0)},
        {1, 1});
    return equation;
  };
  const auto copies_of_start = [&](int num_windows) {
    std::vector<double> times;
    for (int k = 0; k <= num_windows; ++k) times.push_back(k);
    TrainOptions options;
    options.max_num_steps = 1;
    WindowSolutions solutions;
    std::string error;
    EXPECT_TRUE(SolveInWindows(times,
                               start,
                               make_equation,
                               "gradient_descent:step_size=1e-3",
                               options,
                               &solutions,
                               &error))
        << error;
    return token.use_count();
  };
  EXPECT_EQ(copies_of_start(2), copies_of_start(8));
}

}  // namespace time_windows_test
}  // namespace invgrad
