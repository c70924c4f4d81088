// The problems without physics: regression_1d and random_polynomial.

#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "Eigen/Eigenvalues"
#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "invgrad/rules.h"
#include "invgrad/train.h"
#include "problems/problems.h"
#include "problems/regression.h"
#include "tests/support/create_problem.h"
#include "tests/support/train_problem.h"

namespace invgrad {
namespace regression_problems_test {

using Eigen::MatrixXd;
using Eigen::MatrixXi;
using Eigen::VectorXd;

std::string RefusalOf(const std::string& specification, const MatrixXd& data) {
  PhysicsProblem problem;
  std::string error;
  EXPECT_FALSE(CreateProblem(specification, &data, &problem, &error));
  return error;
}

class RegressionProblem : public testing::TestWithParam<std::string> {};

TEST_P(RegressionProblem, HasThePublishedSettings) {
  const LearningProblem problem = CreateLearningProblem(GetParam());
  EXPECT_EQ(problem.train.num_samples(), 10000);
  EXPECT_EQ(problem.test.num_samples(), 10000);
  EXPECT_EQ(problem.batch_size, 32);
  EXPECT_EQ(problem.num_epochs, 20);
  EXPECT_EQ(problem.initialization, Initialization::kPytorch);
  EXPECT_EQ(problem.model->loss().SquaredNormFactor(), 1.0);
}

// g = 2 (y - y*), whatever the batch's size: the benchmark's scaling.
TEST_P(RegressionProblem, LossGradientIsNotDividedByTheBatchSize) {
  const LearningProblem problem =
      CreateLearningProblem(GetParam() + ":num_samples=20");
  NumpyRandom random(1);
  const VectorXd weights =
      problem.model->network().InitialWeights(problem.initialization, &random);
  LinearizationParts parts;
  parts.jacobian = true;
  for (const int batch_size : {1, 20}) {
    const DataSet batch = problem.train.Range(0, batch_size);
    Linearization at_weights;
    std::string error;
    ASSERT_TRUE(
        problem.model->Linearize(weights, batch, parts, &at_weights, &error))
        << error;
    MatrixXd y;
    ASSERT_TRUE(problem.model->Predict(weights, batch, &y, &error)) << error;
    const VectorXd residuals = (y - batch.targets).transpose();
    EXPECT_EQ(at_weights.loss_gradient, 2.0 * residuals);
    EXPECT_NEAR(at_weights.cost, residuals.squaredNorm(), 1e-13 * batch_size);
  }
}

// There is no physics: y is what the network puts out.
TEST_P(RegressionProblem, PredictionIsTheNetworksOutput) {
  const LearningProblem problem =
      CreateLearningProblem(GetParam() + ":num_samples=5");
  NumpyRandom random(1);
  const DenseNetwork& network = *problem.model->dense_network();
  const VectorXd weights =
      network.InitialWeights(problem.initialization, &random);
  MatrixXd y;
  std::string error;
  ASSERT_TRUE(problem.model->Predict(weights, problem.train, &y, &error))
      << error;
  DenseNetwork::Activations activations;
  network.Forward(weights, problem.train.inputs, false, &activations);
  EXPECT_EQ(y, activations.outputs);
}

TEST_P(RegressionProblem, TargetsKnowNeitherUnitNorOrigin) {
  const LearningProblem problem =
      CreateLearningProblem(GetParam() + ":num_samples=100");
  MatrixXd data = problem.data;
  data.rightCols(1) = 7.0 * data.rightCols(1).array() - 3.0;
  const LearningProblem scaled = CreateLearningProblem(GetParam(), &data);
  EXPECT_EQ(scaled.train.inputs, problem.train.inputs);
  // Rounding: some units in the last place of the largest, which is below 10.
  EXPECT_LT((scaled.train.targets - problem.train.targets).norm(), 1e-12);
  EXPECT_LT((scaled.test.targets - problem.test.targets).norm(), 1e-12);
}

TEST_P(RegressionProblem, SeedsAreReproducibleAndDiffer) {
  const LearningProblem a =
      CreateLearningProblem(GetParam() + ":num_samples=30");
  const LearningProblem b =
      CreateLearningProblem(GetParam() + ":num_samples=30");
  const LearningProblem c =
      CreateLearningProblem(GetParam() + ":num_samples=30:data_seed=7");
  EXPECT_EQ(a.data, b.data);
  EXPECT_NE(a.data, c.data);
}

TEST_P(RegressionProblem, RefusesDataThatCannotBeStandardized) {
  const MatrixXd good =
      CreateLearningProblem(GetParam() + ":num_samples=5").data;
  MatrixXd constant = good;
  constant.rightCols(1).setConstant(0.5);
  EXPECT_NE(RefusalOf(GetParam(), constant).find("standard deviation"),
            std::string::npos);
  MatrixXd nan = good;
  nan.rightCols(1)(2) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(RefusalOf(GetParam(), nan).find("standard deviation"),
            std::string::npos);
  // One sample for training.
  EXPECT_NE(RefusalOf(GetParam(), good.topRows(3)).find("standard deviation"),
            std::string::npos);
  EXPECT_NE(RefusalOf(GetParam(), good.leftCols(1)).find("(10, 1)"),
            std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(Regression,
                         RegressionProblem,
                         testing::Values("regression_1d", "random_polynomial"),
                         [](const auto& info) { return info.param; });

TEST(Regression1d, TargetIsThatOfTheHeader) {
  // python3: exp(-10 * a**2) * sin(2 * a)
  EXPECT_EQ(Regression1d::Target(0.0), 0.0);
  EXPECT_DOUBLE_EQ(Regression1d::Target(0.1), 0.17976344431953514);
  EXPECT_DOUBLE_EQ(Regression1d::Target(1.0), 4.1282039311094163e-05);
  EXPECT_EQ(Regression1d::Target(-0.3), -Regression1d::Target(0.3));

  const LearningProblem problem = CreateLearningProblem("regression_1d");
  EXPECT_EQ(problem.model->num_weights(), 593);
  // np.random.seed(0); 2 * np.random.rand() - 1
  EXPECT_EQ(problem.train.inputs(0, 0), 0.09762700785464951);
  EXPECT_GE(problem.train.inputs.minCoeff(), -1.0);
  EXPECT_LT(problem.train.inputs.maxCoeff(), 1.0);
  // Affine in t: the secant through any two samples goes through all.
  const auto t = [&problem](int s) {
    return Regression1d::Target(problem.train.inputs(0, s));
  };
  const auto& y = problem.train.targets;
  const double slope = (y(0, 1) - y(0, 0)) / (t(1) - t(0));
  for (int s = 2; s < 100; ++s) {
    EXPECT_NEAR(y(0, s), y(0, 0) + slope * (t(s) - t(0)), 1e-12);
  }
}

TEST(Regression1d, IsStandardizedByTheUnbiasedVariance) {
  const LearningProblem problem =
      CreateLearningProblem("regression_1d:num_samples=50");
  const VectorXd targets = problem.train.targets.transpose();
  EXPECT_NEAR(targets.mean(), 0.0, 1e-14);
  EXPECT_NEAR(targets.squaredNorm(), 49.0, 1e-12);
  // The test targets have the training targets' origin and unit, not their own.
  EXPECT_GT(std::abs(problem.test.targets.mean()), 1e-3);
}

// The test loss after `num_epochs` with the benchmark's batches.
double TestLossOf(const LearningProblem& problem,
                  const std::string& method,
                  int num_epochs) {
  TrainOptions options;
  options.batch_size = problem.batch_size;
  options.shuffle = true;
  options.max_num_epochs = num_epochs;
  return TrainProblem(problem, method, options).history.back().test_loss;
}

// The benchmark's half-inverse comes to 1.08e-5 after 2.6 epochs, in the mean
// over 15 seeds, its Adam after 13.9. With a factor 1 / B in g, the
// half-inverse would be at 0.5 after three.
TEST(Regression1d, HalfInverseIsAsFastAsPublished) {
  const LearningProblem problem = CreateLearningProblem("regression_1d");
  EXPECT_LT(
      TestLossOf(problem, "half_inverse:step_size=0.005:truncation=1e-6", 3),
      1.08e-5);
  EXPECT_GT(TestLossOf(problem, "adam:step_size=1e-3", 3), 1.08e-5);
}

TEST(RandomPolynomial, IsStandardizedByTheBiasedVariance) {
  const LearningProblem problem =
      CreateLearningProblem("random_polynomial:num_samples=50");
  const VectorXd targets = problem.train.targets.transpose();
  EXPECT_NEAR(targets.mean(), 0.0, 1e-14);
  EXPECT_NEAR(targets.squaredNorm(), 50.0, 1e-12);
  EXPECT_GT(std::abs(problem.test.targets.mean()), 1e-3);
}

TEST(RandomPolynomial, ExponentsAreInTheOrderOfItertools) {
  const MatrixXi p = RandomPolynomial::Exponents();
  ASSERT_EQ(p.rows(), 210);  // binomial(6 + 4, 4)
  ASSERT_EQ(p.cols(), 6);
  const auto row = [&p](int k) {
    return std::vector<int>{
        p(k, 0), p(k, 1), p(k, 2), p(k, 3), p(k, 4), p(k, 5)};
  };
  using Row = std::vector<int>;
  EXPECT_EQ(row(0), (Row{0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(row(1), (Row{1, 0, 0, 0, 0, 0}));
  EXPECT_EQ(row(6), (Row{0, 0, 0, 0, 0, 1}));
  EXPECT_EQ(row(7), (Row{2, 0, 0, 0, 0, 0}));
  EXPECT_EQ(row(8), (Row{1, 1, 0, 0, 0, 0}));
  EXPECT_EQ(row(100), (Row{2, 0, 0, 1, 1, 0}));
  EXPECT_EQ(row(209), (Row{0, 0, 0, 0, 0, 4}));
  // Degree d has binomial(5 + d, d) monomials, all different.
  const std::vector<int> counts = {1, 6, 21, 56, 126};
  std::set<Row> seen;
  int k = 0;
  for (int degree = 0; degree <= 4; ++degree) {
    for (int i = 0; i < counts[degree]; ++i, ++k) {
      EXPECT_EQ(p.row(k).sum(), degree) << "monomial " << k;
      seen.insert(row(k));
    }
  }
  EXPECT_EQ(seen.size(), 210u);
}

// Gauss-Hermite nodes and weights for the standard normal distribution, by
// Golub and Welsch: exact for polynomials up to degree 2 n - 1.
void GaussHermite(int n, VectorXd* nodes, VectorXd* weights) {
  MatrixXd recurrence = MatrixXd::Zero(n, n);
  for (int i = 1; i < n; ++i) {
    recurrence(i, i - 1) = std::sqrt(static_cast<double>(i));
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(recurrence);
  *nodes = solver.eigenvalues();
  *weights = solver.eigenvectors().row(0).cwiseAbs2().transpose();
}

TEST(RandomPolynomial, MonomialsHaveMeanSquareOne) {
  constexpr int kNodes = 5;  // exact up to a_j^9; a_j^8 is needed
  constexpr int kVariables = RandomPolynomial::kNumVariables;
  VectorXd nodes, weights;
  GaussHermite(kNodes, &nodes, &weights);
  constexpr int kNumPoints = 15625;  // kNodes^kVariables
  MatrixXd points(kNumPoints, kVariables);
  VectorXd weight = VectorXd::Ones(kNumPoints);
  for (int i = 0; i < kNumPoints; ++i) {
    for (int j = 0, digits = i; j < kVariables; ++j, digits /= kNodes) {
      points(i, j) = nodes[digits % kNodes];
      weight[i] *= weights[digits % kNodes];
    }
  }
  const MatrixXi p = RandomPolynomial::Exponents();
  int num_shapes = 0;
  for (int k = 0; k < p.rows(); ++k) {
    // The variables are alike: one order of the exponents stands for all.
    bool falling = true;
    for (int j = 1; j < kVariables; ++j) falling &= p(k, j) <= p(k, j - 1);
    if (!falling) continue;
    ++num_shapes;
    const VectorXd m =
        RandomPolynomial::Evaluate(VectorXd::Unit(p.rows(), k), points);
    EXPECT_NEAR(weight.dot(m.cwiseAbs2()), 1.0, 1e-12) << p.row(k);
  }
  EXPECT_EQ(num_shapes, 12);  // the partitions of 0, 1, 2, 3 and 4
}

TEST(RandomPolynomial, DataAreThePublishedOnes) {
  // numpy 2.4.6 and the benchmark's class, without its rounding to single
  // precision. Sums in another order: 1e-14 of a target's size, which is one.
  const LearningProblem problem = CreateLearningProblem("random_polynomial");
  EXPECT_EQ(problem.model->num_weights(), 673);
  VectorXd first(6), last(6), first_test(6);
  first << -1.6414534262148879, -0.09488944643970736, 1.4935256468461893,
      1.0244681945954475, -0.02583546098563862, 1.8970367016572327;
  last << -0.6392334681696633, -1.1377281864274593, 1.496769226238075,
      0.5301714665660728, 0.06907854345760205, -0.6943807746577702;
  first_test << -0.7199105397772729, 0.7309319675840538, 2.10696174351225,
      1.6130819189450079, -0.21387025408606336, -0.29911622114703834;
  EXPECT_EQ(problem.train.inputs.col(0), first);
  EXPECT_EQ(problem.train.inputs.col(9999), last);
  EXPECT_EQ(problem.test.inputs.col(0), first_test);
  EXPECT_NEAR(problem.train.targets(0, 0), 0.3801152613751825, 1e-13);
  EXPECT_NEAR(problem.train.targets(0, 1), -0.10368794309427819, 1e-13);
  EXPECT_NEAR(problem.train.targets(0, 2), -0.07084128171395607, 1e-13);
  EXPECT_NEAR(problem.train.targets(0, 9999), 0.39542045165455003, 1e-13);
  EXPECT_NEAR(problem.test.targets(0, 0), -1.730833546305095, 1e-13);
  EXPECT_NEAR(problem.test.targets(0, 1), -0.3002755454903878, 1e-13);
  EXPECT_NEAR(problem.test.targets(0, 9999), -0.01997566434945696, 1e-13);
  // Before they are standardized.
  EXPECT_NEAR(problem.data(0, 6), 3.2853842637683965, 1e-12);
  EXPECT_NEAR(problem.data(1, 6), -2.9028474310351093, 1e-12);
}

}  // namespace regression_problems_test
}  // namespace invgrad
