// Problems that are differential equations.
#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/equations/equation_simulator.h"
#include "invgrad/train.h"
#include "invgrad/trial_function.h"
#include "problems/equations/allen_cahn.h"
#include "problems/equations/burgers.h"
#include "problems/equations/convection.h"
#include "problems/equations/evolutions.h"
#include "problems/equations/korteweg_de_vries.h"
#include "problems/equations/periodic_evolution.h"
#include "problems/equations/poisson_box.h"
#include "problems/equations/reaction.h"
#include "problems/equations/two_solitons.h"
#include "problems/equations/wave.h"
#include "problems/problems.h"

namespace invgrad {
namespace equations_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

class BurgersTest : public testing::TestWithParam<double> {};

// Differences of the closed form satisfy the equation and its conditions.
TEST_P(BurgersTest, SolutionSatisfiesTheEquation) {
  const double nu = GetParam();
  const auto u = [nu](double t, double x) {
    return BurgersPinn::Solution(nu, t, x);
  };
  for (const double x : {0.1, 0.35, 0.8}) {
    EXPECT_NEAR(u(1e-12, x), -std::sin(M_PI * x), 1e-10);
    // Odd.
    EXPECT_NEAR(u(0.7, -x), -u(0.7, x), 1e-13);
    for (const double t : {0.1, 0.4, 1.0}) {
      EXPECT_NEAR(u(t, 0.0), 0.0, 1e-13);
      EXPECT_NEAR(u(t, 1.0), 0.0, 1e-13);
      constexpr double h = 1e-3;
      const double u_t = (8 * (u(t + h, x) - u(t - h, x)) -
                          (u(t + 2 * h, x) - u(t - 2 * h, x))) /
                         (12 * h);
      const double u_x = (8 * (u(t, x + h) - u(t, x - h)) -
                          (u(t, x + 2 * h) - u(t, x - 2 * h))) /
                         (12 * h);
      const double u_xx = (16 * (u(t, x + h) + u(t, x - h)) -
                           (u(t, x + 2 * h) + u(t, x - 2 * h)) - 30 * u(t, x)) /
                          (12 * h * h);
      // h^4 / 30 times fifth derivatives of some 1e6, as of a front.
      EXPECT_NEAR(u_t + u(t, x) * u_x - nu * u_xx, 0.0, 1e-7)
          << nu << " at " << t << ", " << x;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Viscosities,
                         BurgersTest,
                         testing::Values(0.1, 0.01, 0.01 / M_PI));

// Basdevant et al. Spectral and finite difference solutions of the Burgers
// equation. Computers & Fluids 14 (1986), table 1: the largest slope of the
// front is 152.00516 at pi t = 1.6037.
TEST(Burgers, TheFrontIsThatOfTheLiterature) {
  constexpr double h = 1e-6;
  const double t = 1.6037 / M_PI;
  const double slope = -BurgersPinn::Solution(0.01 / M_PI, t, h) / h;
  EXPECT_NEAR(slope, 152.00516, 1e-3);
}

MatrixXd SomePoints() {
  MatrixXd points(2, 6);
  points << 1.0, 0.0, 0.3, 0.3, 0.7, 0.05,  //
      0.2, -0.4, 0.9, -1.0, 0.5, 0.0;
  return points;
}

// The exact wave of u_t = nu u_xx, and Burgers' closed form.
TEST(PeriodicEvolution, IsTheClosedForm) {
  PeriodicEvolution heat;
  heat.linear = [](double k) { return -0.1 * k * k; };
  heat.nonlinear = [](double) { return 0.0; };
  heat.num_cells = 16;
  heat.time_step = 0.2;
  const auto sine = [](double x) { return -std::sin(M_PI * x); };
  const MatrixXd points = SomePoints();
  const VectorXd u = heat.Solve(sine, points);
  for (int s = 0; s < points.cols(); ++s) {
    EXPECT_NEAR(
        u[s],
        std::exp(-0.1 * M_PI * M_PI * points(0, s)) * sine(points(1, s)),
        1e-14);
  }
  PeriodicEvolution burgers = heat;
  burgers.linear = [](double k) { return -0.02 * k * k; };
  burgers.nonlinear = [](double v) { return -0.5 * v * v; };
  burgers.has_derivative = true;
  burgers.num_cells = 512;
  burgers.time_step = 1e-3;
  const VectorXd v = burgers.Solve(sine, points);
  for (int s = 0; s < points.cols(); ++s) {
    EXPECT_NEAR(
        v[s], BurgersPinn::Solution(0.02, points(0, s), points(1, s)), 1e-10);
  }
}

// Where the linear part turns fast modes quickly, as of Korteweg-de Vries at
// these steps, the order is three.
TEST(PeriodicEvolution, ConvergesWithOrderFour) {
  PeriodicEvolution burgers;
  burgers.linear = [](double k) { return -0.1 * k * k; };
  burgers.nonlinear = [](double u) { return -0.5 * u * u; };
  burgers.has_derivative = true;
  burgers.num_cells = 64;
  const double exact = BurgersPinn::Solution(0.1, 0.4, 0.3);
  const auto error = [&](double h) {
    burgers.time_step = h;
    return burgers.Solve([](double x) { return -std::sin(M_PI * x); },
                         Vector2d(0.4, 0.3))[0] -
           exact;
  };
  EXPECT_NEAR(std::log2(error(0.04) / error(0.02)), 4.0, 0.3);
}

// Half the step and twice the cells change nothing in the ninth digit.
TEST(KortewegDeVries, ReferenceIsFarBelowThePublishedErrors) {
  PeriodicEvolution evolution = KortewegDeVriesPinn::Evolution(4.84e-4);
  const auto cosine = [](double x) { return std::cos(M_PI * x); };
  const VectorXd u = evolution.Solve(cosine, SomePoints());
  evolution.num_cells *= 2;
  evolution.time_step *= 0.5;
  EXPECT_LT((evolution.Solve(cosine, SomePoints()) - u).cwiseAbs().maxCoeff(),
            2e-9);
}

TEST(AllenCahn, ReferenceIsFarBelowThePublishedErrors) {
  PeriodicEvolution evolution = AllenCahnPinn::Evolution(1e-4);
  MatrixXd points(2, 6);
  points << 0.025, 0.1, 0.5, 1.0, 1.0, 0.3,  //
      0.99, 1.0, 0.5, 0.55, 0.0, 0.47;
  const VectorXd u = evolution.SolveByModes(AllenCahnPinn::StartMode, points);
  evolution.num_cells /= 2;
  evolution.time_step *= 2.0;
  const VectorXd coarser =
      evolution.SolveByModes(AllenCahnPinn::StartMode, points);
  EXPECT_LT((coarser - u).cwiseAbs().maxCoeff(), 1e-10);
  // A second way, without the modes: at x = 1 of order N^-2, elsewhere more.
  const VectorXd by_values = evolution.Solve(
      [](double x) { return x * x * std::cos(M_PI * x); }, points);
  EXPECT_LT((by_values - u).cwiseAbs().maxCoeff(), 2e-5);
  EXPECT_NEAR(by_values[2], u[2], 1e-10);
  EXPECT_NEAR(by_values[3], u[3], 1e-10);
}

// w_t = D w_zz, w_z(t, 0) = -1, w(0, z) = 0.
TEST(AllenCahn, TheLayerSolvesItsEquation) {
  constexpr double D = 1e-3;
  const DerivativeSet set("tz", {"t", "z", "zz"});
  const auto w = [&](double t, double z) -> VectorXd {
    return JetsOf(
        set,
        1,
        [](const InputJet* a, InputJet* f) {
          f[0] = AllenCahnPinn::Layer(D, a[0], a[1]);
        },
        Vector2d(t, z));
  };
  for (const double t : {0.01, 0.2, 1.0}) {
    EXPECT_NEAR(w(t, 0.0)[2], -1.0, 1e-13);
    for (const double z : {0.1, 0.03, 0.0}) {
      const VectorXd jet = w(t, z);
      EXPECT_NEAR(jet[1], D * jet[3], 1e-12) << t << " " << z;
    }
  }
  EXPECT_NEAR(w(1e-12, 0.01)[0], 0.0, 1e-15);
}

// The residual of the equation at the jets of the closed form.
template <typename Definition>
void ExpectSolves(const Definition& definition) {
  const EquationProblem problem = definition.MakeEquation();
  const Equation& equation = problem.equation;
  const MatrixXd points = GridPoints(problem.box, {7, 9});
  const MatrixXd u = JetsOf(
      *equation.trial.derivatives,
      1,
      [&definition](const InputJet* a, InputJet* f) {
        f[0] = definition.Solution(a[0], a[1]);
      },
      points);
  for (int s = 0; s < points.cols(); ++s) {
    double y = 1.0;
    ASSERT_TRUE(equation.terms[0].residual->Evaluate(
        u.col(s).data(), nullptr, &y, nullptr));
    // Derivatives of some 500.
    EXPECT_NEAR(y, 0.0, 1e-11) << points.col(s).transpose();
    EXPECT_NEAR(problem.solution(points.col(s)), u(0, s), 1e-15);
  }
}

TEST(ClosedForms, SolveTheEquations) {
  ExpectSolves(ConvectionPinn());
  ExpectSolves(ReactionPinn());
  ExpectSolves(WavePinn());
  ExpectSolves(TwoSolitonsPinn());
}

// The jets of u for any network are those of the closed form at the beginning,
// in the channels that the conditions fix.
template <typename Definition>
void ExpectKeepsConditions(const Definition& definition,
                           const std::vector<std::string>& at_the_beginning,
                           bool at_the_faces) {
  const EquationProblem problem = definition.MakeEquation();
  const TrialFunction& trial = problem.equation.trial;
  const DerivativeSet& set = *trial.derivatives;
  MatrixXd points = GridPoints(problem.box, {3, 9});
  const MatrixXd exact = JetsOf(
      set,
      1,
      [&definition](const InputJet* a, InputJet* f) {
        f[0] = definition.Solution(a[0], a[1]);
      },
      points);
  MatrixXd conditions;
  std::string error;
  ASSERT_TRUE(trial.Conditions(points, &conditions, &error)) << error;
  const MatrixXd any = MatrixXd::Random(set.num_channels(), points.cols());
  const MatrixXd u = trial.Values(any, conditions);
  for (int s = 0; s < points.cols(); ++s) {
    const bool is_face = points(1, s) == problem.box.lower[1] ||
                         points(1, s) == problem.box.upper[1];
    if (points(0, s) == 0.0) {
      for (const std::string& word : at_the_beginning) {
        const int k = set.ChannelOf(word);
        EXPECT_NEAR(u(k, s), exact(k, s), 1e-12) << word;
      }
    } else if (is_face && at_the_faces) {
      EXPECT_NEAR(u(0, s), exact(0, s), 1e-13);
    } else {
      EXPECT_NE(u(0, s), exact(0, s));
    }
  }
}

TEST(ClosedForms, ConditionsHoldForAnyNetwork) {
  ExpectKeepsConditions(ConvectionPinn(), {"", "x"}, false);
  ExpectKeepsConditions(ReactionPinn(), {""}, false);
  ExpectKeepsConditions(WavePinn(), {"", "t", "x", "xx"}, true);
  ExpectKeepsConditions(TwoSolitonsPinn(), {"", "x", "xxx"}, true);
}

TEST(Convection, IsPeriodic) {
  const EquationProblem problem = ConvectionPinn().MakeEquation();
  const TrialFunction& trial = problem.equation.trial;
  MatrixXd ends(2, 2);
  ends << 0.3, 0.3, 0.0, 2.0 * M_PI;
  MatrixXd inputs, conditions;
  std::string error;
  ASSERT_TRUE(trial.Inputs(ends, &inputs, &error)) << error;
  ASSERT_TRUE(trial.Conditions(ends, &conditions, &error)) << error;
  EXPECT_LT((inputs.col(0) - inputs.col(1)).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_LT((conditions.col(0) - conditions.col(1)).cwiseAbs().maxCoeff(),
            1e-14);
}

// The closed forms satisfy their equations and conditions.
TEST(EquationProblems, LossesOfTheSolutionsVanish) {
  // An equation's residual at the true jets: the data's terms have c = u*.
  for (const std::string name : {"heat_4d_pinn:num_points=20:num_face=2",
                                 "poisson_5d_pinn:num_points=20:num_face=2",
                                 "poisson_10d_pinn:num_points=20:num_face=2"}) {
    PhysicsProblem problem;
    std::string error;
    ASSERT_TRUE(CreateProblem(name, nullptr, &problem, &error)) << error;
    const LearningProblem& learning = *problem.learning;
    const auto& simulator =
        dynamic_cast<const EquationSimulator&>(learning.model->simulator());
    const EquationContext& layout = simulator.context_layout();
    const DerivativeSet& set = *simulator.trial_function().derivatives;
    const bool is_heat = layout.weight > 0;
    const int dim = set.num_variables();
    const MatrixXd points =
        learning.train.contexts.middleRows(layout.point, dim);
    const MatrixXd u = JetsOf(
        set,
        1,
        [is_heat, dim](const InputJet* a, InputJet* f) {
          if (!is_heat) {
            f[0] = dim == 5 ? PoissonBoxPinn<5>::SolutionOf(a)
                            : PoissonBoxPinn<10>::SolutionOf(a);
            return;
          }
          f[0] = 0.0;
          for (int i = 1; i < 5; ++i) f[0] += exp(-a[0]) * sin(2.0 * a[i]);
        },
        points);
    MatrixXd x = u;
    // N = (u - g) / t; its jets by those of 1 / t.
    if (is_heat) {
      x -= learning.train.contexts.topRows(u.rows());
      const MatrixXd inverse = JetsOf(
          set,
          1,
          [](const InputJet* a, InputJet* f) { f[0] = 1.0 / a[0]; },
          points);
      const Eigen::Index T = set.num_channels();
      for (Eigen::Index s = 0; s < x.cols(); ++s) {
        MatrixXd jet = x.col(s).transpose();
        jet.resize(1, T);
        const MatrixXd factor = inverse.col(s).reshaped(1, T);
        set.Multiply(factor, jet);
        x.col(s) = jet.reshaped();
      }
    }
    MatrixXd y(1, x.cols());
    ASSERT_EQ(simulator.EvaluateBatch(static_cast<int>(x.cols()),
                                      x.data(),
                                      learning.train.contexts.data(),
                                      y.data(),
                                      nullptr),
              x.cols());
    EXPECT_LT(y.cwiseAbs().maxCoeff(), 1e-9) << name;
  }
}

TEST(Evolutions, AreTheProblemsInAWindow) {
  EvolutionProblem evolution;
  std::string error;
  ASSERT_TRUE(CreateEvolution("kdv_pinn:num_t=4", &evolution, &error)) << error;
  const EquationProblem problem =
      evolution.in_window({0.25, 0.5, evolution.start});
  EXPECT_EQ(problem.box.lower[0], 0.25);
  EXPECT_EQ(problem.equation.terms[0].points.points.cols(), 4 * 128);
  EXPECT_FALSE(CreateEvolution("poisson", &evolution, &error));
  EXPECT_EQ(error.rfind("unknown equation of evolution 'poisson'", 0), 0u)
      << error;
  EXPECT_FALSE(CreateEvolution("kdv_pinn:num_t=0", &evolution, &error));
  EXPECT_NE(error.find("num_t=0"), std::string::npos) << error;
}

// Of a network that is zero, the equation holds, and u = 0 is wrong only at the
// beginning, by sin(pi x), whose mean square is 1/2.
TEST(Burgers, SoftConditionsAreTermsOfTheLoss) {
  PhysicsProblem problem;
  std::string error;
  ASSERT_TRUE(
      CreateProblem("burgers_pinn:num_t=4:num_x=12:conditions=soft:"
                    "condition_weight=10",
                    nullptr,
                    &problem,
                    &error))
      << error;
  const LearningProblem& learning = *problem.learning;
  EXPECT_EQ(learning.train.inputs.cols(), 4 * 12 + 12 + 2 * 4);
  const VectorXd zero = VectorXd::Zero(learning.model->num_weights());
  EXPECT_NEAR(MeanLoss(*learning.model, zero, learning.train), 2.5, 1e-12);
}

TEST(Burgers, NamesPointsOutsideTheBox) {
  PhysicsProblem problem;
  std::string error;
  MatrixXd data(2, 3);
  data << 0.1, 0.2, 1.0, 0.3, -0.4, 1.0;
  EXPECT_FALSE(CreateProblem("burgers_pinn", &data, &problem, &error));
  EXPECT_NE(error.find("data: row 1, column 1 is -0.4; the equation holds in "
                       "[0, 1]"),
            std::string::npos)
      << error;
  data << 0.1, 0.2, 1.0, 0.3, 0.4, 0.0;
  EXPECT_FALSE(CreateProblem("burgers_pinn", &data, &problem, &error));
  EXPECT_NE(error.find("row 1, column 2 is 0; a weight is positive"),
            std::string::npos)
      << error;
}

}  // namespace equations_test
}  // namespace invgrad
