// Problems that are added to the table, as a project of its own does.

#include <memory>
#include <string>
#include <vector>

#include "ceres/autodiff_cost_function.h"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/compare.h"
#include "invgrad/compare/equation_problem.h"
#include "invgrad/compare/sample_data.h"

namespace invgrad {
namespace register_problem_test {

struct Shift {
  template <typename T>
  bool operator()(const T* x, T* residual) const {
    residual[0] = x[0] - 3.0;
    return true;
  }
};

// 1/2 (x - 3)^2 from x = the seed.
struct Parabola {
  double unused = 0.0;
  void Describe(OptionSet* set) {
    set->Add("unused", &unused, {0.0, 1.0}, "a setting");
  }
  bool Create(LeastSquaresProblem* problem, std::string* /*error*/) const {
    problem->minimum = 0.0;
    problem->fill = [](int seed, ceres::Problem* to_fill) {
      auto x = std::make_shared<double>(seed);
      to_fill->AddResidualBlock(
          new ceres::AutoDiffCostFunction<Shift, 1, 1>(new Shift),
          nullptr,
          x.get());
      return x;
    };
    return true;
  }
};

// u' = 0 on [0, 1], u(0) = 1.
struct Constant {
  struct Residual {
    template <typename T>
    bool operator()(const T* u, T* y) const {
      y[0] = u[1];
      return true;
    }
  };
  void Describe(OptionSet* /*set*/) {}
  bool Create(EquationProblem* problem, std::string* /*error*/) const {
    problem->box = {Eigen::VectorXd::Zero(1), Eigen::VectorXd::Ones(1)};
    TrialFunction& trial = problem->equation.trial;
    trial.derivatives =
        std::make_shared<DerivativeSet>("t", std::vector<std::string>{"t"});
    trial.features = ScaledFeatures(problem->box);
    trial.boundary_values = [](const InputJet* /*t*/, InputJet* u) {
      u[0] = InputJet(1.0);
    };
    trial.distance = [](const InputJet* t, InputJet* d) { d[0] = t[0]; };
    problem->equation.terms = {
        {"equation",
         std::make_shared<AutoDiffSimulator<Residual, 2, 1>>(),
         GaussPoints(problem->box, {4})}};
    problem->equation.hidden = {3};
    problem->test_counts = {5};
    return true;
  }
};

// The table is the process's: once for all tests.
void RegisterOnce() {
  if (FindProblem("parabola") != nullptr) return;
  RegisterProblem<Parabola>("parabola", "L = 1/2 (x - 3)^2", "this test");
  RegisterProblem<Constant>("constant", "u' = 0", "this test");
}

TEST(RegisterProblem, FillsAProblemFromASeed) {
  RegisterOnce();
  PhysicsProblem made;
  std::string error;
  ASSERT_TRUE(CreateProblem("parabola:unused=0.5", nullptr, &made, &error))
      << error;
  ASSERT_TRUE(made.least_squares.has_value());
  for (const int seed : {1, 7}) {
    ceres::Problem problem;
    const std::shared_ptr<void> owner =
        made.least_squares->fill(seed, &problem);
    double cost = 0.0;
    ASSERT_TRUE(problem.Evaluate({}, &cost, nullptr, nullptr, nullptr));
    EXPECT_EQ(cost, 0.5 * (seed - 3.0) * (seed - 3.0));
  }
}

TEST(RegisterProblem, AnEquationNeedsNoKnownSolution) {
  RegisterOnce();
  PhysicsProblem made;
  std::string error;
  ASSERT_TRUE(CreateProblem("constant", nullptr, &made, &error)) << error;
  ASSERT_TRUE(made.learning.has_value());
  EXPECT_FALSE(made.learning->metric.has_value());
  EXPECT_EQ(made.learning->train.num_samples(), 4);
  EXPECT_EQ(made.learning->test.num_samples(), 5);
}

// A reference may take seconds, and listings and messages need none.
TEST(RegisterProblem, AKnownSolutionIsComputedOnceAtItsFirstUse) {
  EquationProblem equation;
  std::string error;
  ASSERT_TRUE(Constant().Create(&equation, &error)) << error;
  EXPECT_FALSE(equation.HasSolution());
  int num_solved = 0;
  equation.solution_at = [&num_solved](const Eigen::MatrixXd& points) {
    ++num_solved;
    return Eigen::VectorXd(Eigen::VectorXd::Ones(points.cols()));
  };
  EXPECT_TRUE(equation.HasSolution());
  LearningProblem problem;
  ASSERT_TRUE(CreateEquationProblem(equation, &problem, &error)) << error;
  ASSERT_TRUE(problem.metric.has_value());
  EXPECT_EQ(num_solved, 0);
  // With N = 0 the trial function is the solution, u = 1.
  const Eigen::MatrixXd x = Eigen::MatrixXd::Zero(
      problem.model->simulator().num_inputs(), problem.test.num_samples());
  EXPECT_EQ(problem.metric->evaluate(x, problem.test), 0.0);
  EXPECT_EQ(problem.metric->evaluate(x, problem.test), 0.0);
  EXPECT_EQ(num_solved, 1);
}

TEST(RegisterProblem, SettingsAndDataAreChecked) {
  RegisterOnce();
  PhysicsProblem made;
  std::string error;
  EXPECT_FALSE(CreateProblem("parabola:unused=2", nullptr, &made, &error));
  EXPECT_NE(error.find("unused=2"), std::string::npos) << error;
  EXPECT_FALSE(CreateProblem("parabole", nullptr, &made, &error));
  EXPECT_NE(error.find("did you mean parabola"), std::string::npos) << error;
  const Eigen::MatrixXd data = Eigen::MatrixXd::Ones(2, 1);
  EXPECT_FALSE(CreateProblem("parabola", &data, &made, &error));
  EXPECT_NE(error.find("no data to replace"), std::string::npos) << error;
}

TEST(RegisterProblemDeathTest, NamesAreNewAndHaveNoSeparators) {
  RegisterOnce();
  const auto add = [](const std::string& name) {
    RegisterProblem<Parabola>(name, "L", "this test");
  };
  EXPECT_DEATH(add("parabola"), "already a problem 'parabola'");
  for (const char* name : {"", "a b", "a:b", "a=b", "a,b", "a;b"}) {
    EXPECT_DEATH(add(name), "cannot be the name of a problem");
  }
}

// A wrong number would let a run refuse its own data.npy.
TEST(MakeData, RefusesGeneratedDataOfAnotherShape) {
  const auto generate = [](int num_rows) {
    return Eigen::MatrixXd(Eigen::MatrixXd::Zero(num_rows, 4));
  };
  LearningProblem problem;
  std::string error;
  EXPECT_TRUE(MakeData({8, 4, 8.0}, generate, &problem, &error)) << error;
  LearningProblem other;
  EXPECT_FALSE(MakeData({8, 3, 8.0}, generate, &other, &error));
  EXPECT_EQ(error,
            "the problem generates data of shape (16, 4), and its SampleSize "
            "says (16, 3): 2 num_samples, num_columns");
  const auto too_few = [](int num_rows) {
    return Eigen::MatrixXd(Eigen::MatrixXd::Zero(num_rows / 2, 4));
  };
  LearningProblem half;
  EXPECT_FALSE(MakeData({8, 4, 8.0}, too_few, &half, &error));
  EXPECT_NE(error.find("(8, 4)"), std::string::npos) << error;
}

}  // namespace register_problem_test
}  // namespace invgrad
