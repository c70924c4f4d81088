#include "problems/random_polynomial.h"

#include <cmath>
#include <cstdint>
#include <vector>

#include "glog/logging.h"
#include "invgrad/io/numpy_generator.h"
#include "problems/regression.h"

namespace invgrad {
namespace {

// zlib.crc32 of the streams' names.
constexpr std::uint32_t kCoefficients = 0x9ec960cf;  // b"coeffs"
constexpr std::uint32_t kTraining = 0xaf91a986;      // b"pool"
constexpr std::uint32_t kTesting = 0x97dfba65;       // b"val"

NumpyGenerator Stream(int data_seed, std::uint32_t crc) {
  return NumpyGenerator((static_cast<std::uint32_t>(data_seed) ^ crc) &
                        0x7fffffffU);
}

// Appends the exponents of all monomials with `degree` more factors from the
// variables `first` and later.
void AppendExponents(int first,
                     int degree,
                     Eigen::RowVectorXi* exponents,
                     std::vector<Eigen::RowVectorXi>* all) {
  if (degree == 0) {
    all->push_back(*exponents);
    return;
  }
  for (int j = first; j < exponents->size(); ++j) {
    ++(*exponents)[j];
    AppendExponents(j, degree - 1, exponents, all);
    --(*exponents)[j];
  }
}

}  // namespace

Eigen::MatrixXi RandomPolynomial::Exponents() {
  std::vector<Eigen::RowVectorXi> rows;
  Eigen::RowVectorXi exponents = Eigen::RowVectorXi::Zero(kNumVariables);
  for (int degree = 0; degree <= kDegree; ++degree) {
    AppendExponents(0, degree, &exponents, &rows);
  }
  Eigen::MatrixXi all(rows.size(), kNumVariables);
  for (size_t k = 0; k < rows.size(); ++k) all.row(k) = rows[k];
  return all;
}

Eigen::VectorXd RandomPolynomial::Evaluate(const Eigen::VectorXd& c,
                                           const Eigen::MatrixXd& inputs) {
  const Eigen::MatrixXi exponents = Exponents();
  CHECK_EQ(c.size(), exponents.rows());
  CHECK_EQ(inputs.cols(), kNumVariables);
  Eigen::ArrayXd values = Eigen::ArrayXd::Zero(inputs.rows());
  for (int k = 0; k < exponents.rows(); ++k) {
    Eigen::ArrayXd product = Eigen::ArrayXd::Ones(inputs.rows());
    double mean_square = 1.0;
    for (int j = 0; j < kNumVariables; ++j) {
      for (int power = 1; power <= exponents(k, j); ++power) {
        product *= inputs.col(j).array();
        mean_square *= 2 * power - 1;
      }
    }
    values += c[k] / std::sqrt(mean_square) * product;
  }
  return values;
}

bool RandomPolynomial::Create(const Options& options,
                              const Eigen::MatrixXd* data,
                              LearningProblem* problem,
                              std::string* error) {
  constexpr int kNumColumns = kNumVariables + 1;
  const auto normal = [&options](std::uint32_t crc, int rows, int cols) {
    return Stream(options.data_seed, crc).StandardNormal(rows, cols);
  };
  const auto generate = [&](int num_rows) {
    const int n = num_rows / 2;
    Eigen::MatrixXd samples(num_rows, kNumColumns);
    samples.topLeftCorner(n, kNumVariables) =
        normal(kTraining, n, kNumVariables);
    samples.bottomLeftCorner(n, kNumVariables) =
        normal(kTesting, n, kNumVariables);
    const int num_monomials = static_cast<int>(Exponents().rows());
    samples.rightCols(1) = Evaluate(normal(kCoefficients, num_monomials, 1),
                                    samples.leftCols(kNumVariables));
    return samples;
  };
  if (!MakeData({options.num_samples, kNumColumns, kNumColumns, ""},
                data,
                generate,
                problem,
                error) ||
      !MakeRegression(Variance::kBiased, problem, error)) {
    return false;
  }
  AddTargetNoise(options.noise, options.data_seed, problem);
  return true;
}

}  // namespace invgrad
