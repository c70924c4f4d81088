#include "problems/poisson_inverse.h"

#include <cmath>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "Eigen/LU"
#include "gtest/gtest.h"
#include "invgrad/inverse/simulator_pull_back.h"
#include "problems/poisson.h"
#include "tests/support/create_problem.h"
#include "tests/support/simulator_identities.h"
#include "tests/support/train_problem.h"

namespace invgrad {
namespace poisson_inverse_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST(SineGrid, IsTheSumOfItsHeaderAndItsOwnInverse) {
  const struct {
    int rows, cols;
  } kShapes[] = {{1, 1}, {1, 6}, {4, 4}, {3, 5}, {8, 2}};
  for (const auto& shape : kShapes) {
    const SineGrid grid(shape.rows, shape.cols);
    const VectorXd x = NormalVector(grid.num_cells(), 1);
    VectorXd X(x.size()), again(x.size());
    grid.Transform(x.data(), X.data());
    const auto sine = [](int p, int i, int n) {
      return std::sin(p * M_PI * (i + 1) / (n + 1));
    };
    for (int p = 1; p <= shape.rows; ++p) {
      for (int q = 1; q <= shape.cols; ++q) {
        double sum = 0.0;
        for (int i = 0; i < shape.rows; ++i) {
          for (int j = 0; j < shape.cols; ++j) {
            sum += x[shape.cols * i + j] * sine(p, i, shape.rows) *
                   sine(q, j, shape.cols);
          }
        }
        sum *= 2.0 / std::sqrt((shape.rows + 1.0) * (shape.cols + 1.0));
        EXPECT_NEAR(X[shape.cols * (p - 1) + q - 1], sum, 1e-13);
      }
    }
    grid.Transform(X.data(), again.data());
    EXPECT_LT((again - x).norm(), 1e-14 * x.norm());
  }
}

TEST(InverseLaplacian, InvertsTheStencil) {
  for (const int n : {1, 2, 7, 16}) {
    const InverseLaplacian simulator(SineGrid(n, n));
    const VectorXd x = NormalVector(n * n, 2);
    VectorXd y(x.size());
    ASSERT_TRUE(simulator.Evaluate(x.data(), nullptr, y.data(), nullptr));
    EXPECT_LT((Poisson::Laplacian(n) * y - x).norm(), 1e-13 * x.norm());
  }
}

TEST(InverseLaplacian, AppliesItsJacobianOnEveryGrid) {
  const InverseLaplacian small(SineGrid(6, 6));
  ExpectAdjointIdentity(small, NormalVector(36, 3), nullptr);
  EXPECT_TRUE(small.forms_jacobian());
  const VectorXd x = NormalVector(36, 4);
  VectorXd y(36);
  MatrixXd J(36, 36);
  for (int repeat = 0; repeat < 2; ++repeat) {
    ASSERT_TRUE(small.Evaluate(x.data(), nullptr, y.data(), J.data()));
    const MatrixXd A = Poisson::Laplacian(6);
    EXPECT_LT((J * A - MatrixXd::Identity(36, 36)).norm(), 1e-12);
  }
  const InverseLaplacian large(SineGrid(33, 33));
  ExpectAdjointIdentity(large, NormalVector(33 * 33, 5), nullptr);
  EXPECT_FALSE(large.forms_jacobian());
}

TEST(InverseLaplacian, FailsWhereAValueIsNotFinite) {
  const InverseLaplacian simulator(SineGrid(2, 2));
  VectorXd x = VectorXd::Zero(4);
  x[1] = std::nan("");
  VectorXd y(4), x_bar(4);
  EXPECT_FALSE(simulator.Evaluate(x.data(), nullptr, y.data(), nullptr));
  EXPECT_EQ(simulator.Linearize(x.data(), nullptr, y.data()), nullptr);
  const auto ones = [](const double*, double* w) {
    std::fill_n(w, 4, 1.0);
    return true;
  };
  EXPECT_FALSE(
      simulator.Adjoint(x.data(), nullptr, ones, y.data(), x_bar.data()));
}

// Hides that the simulator is linear, so that each sample is decomposed.
class Plain final : public Simulator {
 public:
  explicit Plain(const Simulator* simulator) : simulator_(*simulator) {}
  int num_inputs() const override { return simulator_.num_inputs(); }
  int num_outputs() const override { return simulator_.num_outputs(); }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override {
    return simulator_.Evaluate(x, context, y, jacobian);
  }

 private:
  const Simulator& simulator_;
};

VectorXd PullBack(const std::shared_ptr<const Simulator>& simulator,
                  SimulatorWay way,
                  double truncation,
                  const VectorXd& x,
                  const VectorXd& d_y) {
  SimulatorPullBack::Options options;
  options.way = way;
  options.truncation = truncation;
  const SimulatorPullBack pull_back(simulator, nullptr, options);
  const auto wanted = [&](const double* /*y*/, double* change) {
    Eigen::Map<VectorXd>(change, d_y.size()) = d_y;
    return true;
  };
  VectorXd y(d_y.size()), d_x(x.size());
  SimulatorPullBack::Result result;
  EXPECT_TRUE(pull_back(x, VectorXd(), wanted, y.data(), d_x, &result));
  EXPECT_EQ(result.why, "");
  return d_x;
}

// Truncations that lie between singular values, 0.06 apart or more.
TEST(DiagonalSimulator, PullsBackAsADecompositionForEachSample) {
  const LearningProblem poisson =
      CreateLearningProblem("poisson_inverse:resolution=5:num_samples=1");
  const LearningProblem heat =
      CreateLearningProblem("heat:resolution=6:num_samples=1:nu_t=60");
  for (const LearningProblem* problem : {&poisson, &heat}) {
    const auto simulator = problem->model->shared_simulator();
    const auto plain = std::make_shared<Plain>(simulator.get());
    const VectorXd x = NormalVector(simulator->num_inputs(), 6);
    const VectorXd d_y = NormalVector(simulator->num_outputs(), 7);
    for (const SimulatorWay way :
         {SimulatorWay::kInverseGradient, SimulatorWay::kHalfInverse}) {
      for (const double truncation : {1e-6, 0.0, 0.3}) {
        const VectorXd expected = PullBack(plain, way, truncation, x, d_y);
        EXPECT_LT(
            (PullBack(simulator, way, truncation, x, d_y) - expected).norm(),
            1e-10 * expected.norm());
      }
    }
  }
  const auto simulator = poisson.model->shared_simulator();
  const VectorXd x = NormalVector(25, 6);
  const VectorXd d_y = NormalVector(25, 7);
  const VectorXd expected = Poisson::Laplacian(5) * d_y;
  EXPECT_LT(
      (PullBack(simulator, SimulatorWay::kInverse, 1e-5, x, d_y) - expected)
          .norm(),
      1e-13 * expected.norm());
}

TEST(PoissonInverse, FieldsAreThoseOfPoissonWithoutTheCoarsest) {
  // k^2 <= 0.1 is the mean only.
  for (const int n : {2, 3, 8}) {
    EXPECT_LT((PoissonInverse::RandomSources(5, n, 1) -
               Poisson::SmoothFields(5, n, 1))
                  .norm(),
              1e-13 * n * 5);
  }
  const int n = 64;
  const MatrixXd fields = PoissonInverse::RandomSources(2, n, 1);
  const auto amplitude = [&](int s, int m_0, int m_1) {
    double cosine = 0.0, sine = 0.0;
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        const double angle = 2.0 * M_PI * (m_0 * i + m_1 * j) / n;
        cosine += fields(s, n * i + j) * std::cos(angle);
        sine += fields(s, n * i + j) * std::sin(angle);
      }
    }
    return std::hypot(cosine, sine);
  };
  for (int s = 0; s < 2; ++s) {
    EXPECT_NEAR(fields.row(s).squaredNorm(), n * n, 1e-9);
    for (int m_0 = 0; m_0 <= 2; ++m_0) {
      for (int m_1 = -2; m_1 <= 2; ++m_1) {
        const bool is_cut = m_0 * m_0 + m_1 * m_1 < 5;
        EXPECT_EQ(amplitude(s, m_0, m_1) < 1e-9, is_cut) << m_0 << ", " << m_1;
      }
    }
  }
}

TEST(PoissonInverse, HasTheSettingsOfItsHeader) {
  const LearningProblem problem = CreateLearningProblem("poisson_inverse");
  EXPECT_EQ(problem.model->network().num_inputs(), 256);
  EXPECT_EQ(problem.model->num_weights(), 82432);
  EXPECT_EQ(problem.model->reduction(), Reduction::kSum);
  EXPECT_EQ(problem.model->loss().SquaredNormFactor(), 0.5);
  EXPECT_EQ(problem.batch_size, 128);
  const MatrixXd A = Poisson::Laplacian(16);
  EXPECT_LT((A * problem.test.targets - problem.test.solutions).norm(),
            1e-12 * problem.test.solutions.norm());
  EXPECT_EQ(problem.test.inputs, problem.test.targets);
}

// P is linear, so x~ is x_gt wherever x is.
TEST(PoissonInverse, SipIsSupervisedTraining) {
  const LearningProblem problem =
      CreateLearningProblem("poisson_inverse:num_samples=256");
  const auto simulator = problem.model->shared_simulator();
  for (int s = 0; s < 10; ++s) {
    const VectorXd x = 3.0 * NormalVector(256, s);
    const VectorXd x_gt = problem.train.solutions.col(s);
    VectorXd y(256);
    ASSERT_TRUE(simulator->Evaluate(x.data(), nullptr, y.data(), nullptr));
    const VectorXd d_x = PullBack(simulator,
                                  SimulatorWay::kInverse,
                                  1e-5,
                                  x,
                                  problem.train.targets.col(s) - y);
    EXPECT_LT((x + d_x - x_gt).norm(), 1e-12 * x_gt.norm());
  }
  TrainOptions options;
  options.max_num_steps = 20;
  const VectorXd start = InitialWeights(problem);
  const VectorXd sip =
      TrainProblem(problem, "newton/inverse/adam", options).weights;
  const VectorXd supervised =
      TrainProblem(problem, "newton/data/adam", options).weights;
  EXPECT_GT((sip - start).norm(), 1e-2);
  EXPECT_LT((sip - supervised).norm(), 1e-6 * (sip - start).norm());
}

// The Jacobian of 33 x 33 cells is never formed.
TEST(PoissonInverse, TrainsOnGridsThatFormNoJacobian) {
  const LearningProblem problem =
      CreateLearningProblem("poisson_inverse:resolution=33:num_samples=32");
  TrainOptions options;
  options.max_num_steps = 10;
  for (const char* method : {"adam",
                             "newton/inverse/adam",
                             "newton/half_inverse/adam",
                             "newton/inverse_gradient/adam"}) {
    const TrainResult result = TrainProblem(problem, method, options);
    ASSERT_NE(result.summary.termination_type, ceres::FAILURE)
        << result.summary.message;
    const auto loss = [&problem](const VectorXd& weights) {
      return MeanLoss(*problem.model, weights, problem.train);
    };
    EXPECT_LT(loss(result.weights), loss(InitialWeights(problem))) << method;
  }
}

TEST(PoissonInverse, BadSettingsAndDataAreRefused) {
  PhysicsProblem problem;
  std::string error;
  EXPECT_FALSE(
      CreateProblem("poisson_inverse:resolution=1", nullptr, &problem, &error));
  EXPECT_NE(error.find("resolution=1"), std::string::npos) << error;
  const MatrixXd data = MatrixXd::Zero(10, 255);
  EXPECT_FALSE(CreateProblem("poisson_inverse", &data, &problem, &error));
  EXPECT_NE(error.find("(10, 255)"), std::string::npos) << error;
}

}  // namespace poisson_inverse_test
}  // namespace invgrad
