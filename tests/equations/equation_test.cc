#include "invgrad/equation.h"

#include <cmath>
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/train.h"
#include "tests/equations/decay.h"
#include "tests/support/log_warnings.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace equation_test {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// With values at three points of weight 5 beside the equation.
Equation WithMeasurements() {
  Equation decay = DecayEquation(2.0);
  EquationTerm values;
  values.name = "values";
  values.residual = std::make_shared<ValueResidual>(decay.trial, 1);
  values.points.points = RandomMatrix(2, 3, 1).cwiseAbs();
  values.points.weights = VectorXd::Constant(3, 1.0 / 3.0);
  values.weight = 5.0;
  values.context = [](const VectorXd&, Index s, auto c) {
    c[0] = 0.5 * static_cast<double>(s);
  };
  decay.terms.push_back(values);
  return decay;
}

TEST(Equation, LossIsTheWeightedSumOfMeanSquares) {
  const Equation equation = WithMeasurements();
  const Model model = EquationModel(equation);
  DataSet samples;
  std::string error;
  ASSERT_TRUE(EquationSamples(equation, &samples, &error)) << error;
  ASSERT_EQ(samples.num_samples(), NumPoints(equation));
  const VectorXd weights = RandomMatrix(model.num_weights(), 1, 2);
  double loss = 0.0;
  ASSERT_TRUE(model.Cost(weights, samples, &loss, &error)) << error;
  double expected = 0.0;
  for (const EquationTerm& term : equation.terms) {
    MatrixXd u, later;
    ASSERT_TRUE(Solution(equation, weights, term.points.points, &u, &error));
    constexpr double h = 1e-5;
    MatrixXd earlier;
    MatrixXd shift = MatrixXd::Zero(2, u.cols());
    shift.row(0).setConstant(h);
    ASSERT_TRUE(Solution(
        equation, weights, term.points.points + shift, &later, &error));
    ASSERT_TRUE(Solution(
        equation, weights, term.points.points - shift, &earlier, &error));
    for (Index s = 0; s < u.cols(); ++s) {
      const double R = term.name == "values"
                           ? u(s) - 0.5 * static_cast<double>(s)
                           : (later(s) - earlier(s)) / (2 * h) + 2.0 * u(s);
      expected += term.weight * term.points.weights[s] * 0.5 * R * R;
    }
  }
  // Of the differences: h^2.
  EXPECT_NEAR(loss, expected, 1e-8 * expected);
}

TEST(Equation, IsSolved) {
  const Equation decay = DecayEquation(2.0);
  DataSet samples;
  std::string error;
  ASSERT_TRUE(EquationSamples(decay, &samples, &error)) << error;
  TrainOptions options;
  options.batch_size = 0;
  options.max_num_steps = 150;
  const TrainResult result =
      Train(EquationModel(decay), samples, "geodesic", options);
  ASSERT_EQ(result.error, "");
  const MatrixXd points = GridPoints(kDecayBox, {5, 7});
  MatrixXd u;
  ASSERT_TRUE(Solution(decay, result.weights, points, &u, &error)) << error;
  for (Index s = 0; s < points.cols(); ++s) {
    // As well as eight neurons know u.
    EXPECT_NEAR(u(s), DecaySolution(2.0, points.col(s)), 1e-3);
  }
}

TEST(Equation, NamesWeightsAndContextsThatAreNotAllowed) {
  DataSet samples;
  std::string error;
  Equation weighted = WithMeasurements();
  weighted.terms[1].weight = -1.0;
  EXPECT_FALSE(EquationSamples(weighted, &samples, &error));
  EXPECT_EQ(error,
            "values: a weight of the term or of a point is negative or not a "
            "number; allowed: 0 and above");
  Equation measured = WithMeasurements();
  measured.terms[1].context = [](const VectorXd&, Index s, auto c) {
    c[0] = s == 2 ? std::nan("") : 0.0;
  };
  EXPECT_FALSE(EquationSamples(measured, &samples, &error));
  EXPECT_EQ(error, "values: its context is not finite at point 2");
}

TEST(EquationDeathTest, NeedsItsParts) {
  Equation decay = DecayEquation(1.0);
  decay.terms[0].residual = nullptr;
  EXPECT_DEATH(EquationModel(decay), "it has no residual");
  decay = DecayEquation(1.0);
  decay.trial.derivatives = nullptr;
  EXPECT_DEATH(EquationModel(decay), "no trial.derivatives");
}

TEST(Equation, NamesTermPointAndDerivative) {
  Equation decay = DecayEquation(1.0);
  decay.trial.distance = [](const InputJet* a, InputJet* d) {
    d[0] = sqrt(a[0] - 0.5);
  };
  DataSet samples;
  std::string error;
  EXPECT_FALSE(EquationSamples(decay, &samples, &error));
  EXPECT_EQ(
      error.rfind("decay: distance 0: its value is not finite at point 0", 0),
      0u)
      << error;
}

TEST(Equation, WarnsOfLargeCoordinatesThatFeaturesScale) {
  Equation decay = DecayEquation(2.0, 0.0, 2000.0);
  const auto num_warnings = [&decay](const std::string& words) {
    DataSet samples;
    std::string error;
    EXPECT_TRUE(EquationSamples(decay, &samples, &error)) << error;
    TrainOptions options;
    options.max_num_steps = 1;
    const LogWarnings warnings;
    Train(EquationModel(decay), samples, "adam", options);
    return warnings.Count(words);
  };
  EXPECT_EQ(num_warnings("ScaledFeatures (trial_function.h)"), 1);
  decay.trial.features = ScaledFeatures(
      {Eigen::Vector2d(0.0, -1.0), Eigen::Vector2d(2000.0, 1.0)});
  EXPECT_EQ(num_warnings(""), 0);
}

}  // namespace equation_test
}  // namespace invgrad
