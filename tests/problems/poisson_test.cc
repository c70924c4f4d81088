#include "problems/poisson.h"

#include <cmath>
#include <complex>
#include <string>

#include "gtest/gtest.h"
#include "problems/problems.h"
#include "tests/support/create_problem.h"

namespace invgrad {
namespace poisson_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST(Poisson, LaplacianHasSinesAsEigenvectors) {
  for (const int n : {2, 5, 8}) {
    const MatrixXd A = Poisson::Laplacian(n);
    EXPECT_EQ(A, A.transpose());
    const auto sine = [n](int p, int i) {
      return std::sin(p * M_PI * (i + 1) / (n + 1));
    };
    for (int p = 1; p <= n; ++p) {
      for (int q = 1; q <= n; ++q) {
        VectorXd v(n * n);
        for (int i = 0; i < n; ++i) {
          for (int j = 0; j < n; ++j) v[n * i + j] = sine(p, i) * sine(q, j);
        }
        const double eigenvalue = 2.0 * std::cos(p * M_PI / (n + 1)) +
                                  2.0 * std::cos(q * M_PI / (n + 1)) - 4.0;
        EXPECT_LT((A * v - eigenvalue * v).norm(), 1e-13) << p << ", " << q;
      }
    }
  }
}

TEST(Poisson, FieldsHaveMeanZeroAndVarianceOne) {
  for (const int n : {2, 3, 8}) {
    const MatrixXd fields = Poisson::SmoothFields(20, n, 1);
    ASSERT_EQ(fields.rows(), 20);
    for (int s = 0; s < 20; ++s) {
      EXPECT_NEAR(fields.row(s).mean(), 0.0, 1e-14);
      EXPECT_NEAR(fields.row(s).squaredNorm() / (n * n), 1.0, 1e-14);
    }
  }
}

// The power of wave vector k falls as |k|^-4. Within a field it is the square
// of a complex normal number, so the logarithm of a ratio of two has the
// standard deviation pi / sqrt(3); its mean over the fields that by the root of
// their number.
TEST(Poisson, FieldsHaveTheSpectrumOfTheHeader) {
  const int n = 8;
  const int num_fields = 4000;
  const MatrixXd fields = Poisson::SmoothFields(num_fields, n, 2);
  const auto log_power = [&](int s, int k_1, int k_2) {
    std::complex<double> sum = 0.0;
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        sum += fields(s, n * i + j) *
               std::polar(1.0, -2.0 * M_PI * (k_1 * i + k_2 * j) / n);
      }
    }
    return std::log(std::norm(sum));
  };
  const int kVectors[][2] = {{0, 1}, {1, 1}, {2, 0}, {1, -2}, {3, 3}};
  for (const auto& k : kVectors) {
    double mean = 0.0;
    for (int s = 0; s < num_fields; ++s) {
      mean += (log_power(s, 1, 0) - log_power(s, k[0], k[1])) / num_fields;
    }
    const double deviation = M_PI / std::sqrt(3.0 * num_fields);
    EXPECT_NEAR(
        mean, 2.0 * std::log(k[0] * k[0] + k[1] * k[1]), 4.0 * deviation)
        << k[0] << ", " << k[1];
  }
}

TEST(Poisson, HasThePublishedSizes) {
  const LearningProblem problem = CreateLearningProblem("poisson");
  EXPECT_EQ(problem.model->num_weights(), 24896);
  EXPECT_EQ(problem.model->reduction(), Reduction::kSum);
  EXPECT_EQ(problem.model->loss().SquaredNormFactor(), 0.5);
  EXPECT_EQ(problem.batch_size, 64);
}

TEST(Poisson, NetworkSeesTheLaplacianOfTheFields) {
  const LearningProblem problem =
      CreateLearningProblem("poisson:num_samples=30:resolution=5");
  ASSERT_EQ(problem.data.rows(), 60);
  const MatrixXd y = MatrixXd(Poisson::Laplacian(5)) * problem.data.transpose();
  EXPECT_LT((problem.train.targets - y.leftCols(30)).norm(), 1e-12);
  EXPECT_LT((problem.test.targets - y.rightCols(30)).norm(), 1e-12);
  EXPECT_EQ(problem.train.inputs, problem.train.targets);
  EXPECT_EQ(problem.test.inputs, problem.test.targets);
  EXPECT_EQ(problem.train.solutions, problem.data.transpose().leftCols(30));
  EXPECT_EQ(problem.test.solutions, problem.data.transpose().rightCols(30));
  EXPECT_EQ(problem.batch_size, 30);
}

TEST(Poisson, SeedDecidesOnTheFields) {
  EXPECT_EQ(Poisson::SmoothFields(3, 4, 7), Poisson::SmoothFields(3, 4, 7));
  EXPECT_NE(Poisson::SmoothFields(3, 4, 7), Poisson::SmoothFields(3, 4, 8));
  // More fields do not change the first.
  EXPECT_EQ(Poisson::SmoothFields(5, 4, 7).topRows(3),
            Poisson::SmoothFields(3, 4, 7));
}

TEST(Poisson, BadSettingsAndDataAreRefused) {
  PhysicsProblem problem;
  std::string error;
  EXPECT_FALSE(
      CreateProblem("poisson:resolution=1", nullptr, &problem, &error));
  EXPECT_NE(error.find("resolution=1"), std::string::npos) << error;
  const MatrixXd data = MatrixXd::Zero(10, 63);
  EXPECT_FALSE(CreateProblem("poisson", &data, &problem, &error));
  EXPECT_NE(error.find("(10, 63)"), std::string::npos) << error;
}

}  // namespace poisson_test
}  // namespace invgrad
