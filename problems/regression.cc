#include "problems/regression.h"

#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/loss.h"
#include "invgrad/random.h"
#include "invgrad/simulator.h"

namespace invgrad {
namespace {

// Makes the samples from problem->data. The variance of N targets has the factor
// 1 / (N - ddof). Returns false, with *error set, if the deviation of the
// training targets is not positive and finite.
bool MakeRegression(int ddof, LearningProblem* problem, std::string* error) {
  const int num_inputs = static_cast<int>(problem->data.cols()) - 1;
  DataSet all;
  all.inputs = problem->data.leftCols(num_inputs).transpose();
  all.targets = problem->data.rightCols(1).transpose();
  SplitSamples(all, 32, problem);

  const Eigen::ArrayXXd targets = problem->train.targets;
  const double mean = targets.mean();
  const double count = static_cast<double>(targets.size());
  const double deviation =
      std::sqrt((targets - mean).square().sum() / (count - ddof));
  if (!(deviation > 0.0 && std::isfinite(deviation))) {
    *error = fmt::format(
        "the training targets (the last column of the first {} samples) have "
        "no positive, finite standard deviation",
        targets.size());
    return false;
  }
  for (DataSet* part : {&problem->train, &problem->test}) {
    part->targets = (part->targets.array() - mean) / deviation;
  }

  problem->model = std::make_shared<Model>(
      DenseNetwork({num_inputs, 16, 16, 16, 1}, Activation::kGelu),
      std::make_shared<IdentitySimulator>(1),
      std::make_shared<SquaredNormLoss>(1, 1.0),
      Reduction::kSum);
  problem->initialization = Initialization::kPytorch;
  problem->num_epochs = 20;
  return true;
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

double Regression1d::Target(double a) {
  return std::exp(-10.0 * a * a) * std::sin(2.0 * a);
}

bool Regression1d::Create(LearningProblem* problem, std::string* error) const {
  const auto generate = [this](int num_rows) {
    NumpyRandom random(static_cast<std::uint32_t>(data_seed));
    Eigen::MatrixXd samples(num_rows, 2);
    samples.col(0) = -1.0 + 2.0 * random.Rand(num_rows, 1).array();
    samples.col(1) = samples.col(0).unaryExpr(&Target);
    return samples;
  };
  if (!MakeData({num_samples, 2, 2.0}, generate, problem, error) ||
      !MakeRegression(/*ddof=*/1, problem, error)) {
    return false;
  }
  AddTargetNoise(noise, data_seed, problem);
  return true;
}

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

bool RandomPolynomial::Create(LearningProblem* problem,
                              std::string* error) const {
  constexpr int kNumColumns = kNumVariables + 1;
  // `crc`: zlib.crc32 of the stream's name.
  const auto normal = [this](std::uint32_t crc, int rows, int cols) {
    return NumpyGenerator((static_cast<std::uint32_t>(data_seed) ^ crc) &
                          0x7fffffffU)
        .StandardNormal(rows, cols);
  };
  const auto generate = [&](int num_rows) {
    const int n = num_rows / 2;
    Eigen::MatrixXd samples(num_rows, kNumColumns);
    samples.topLeftCorner(n, kNumVariables) =
        normal(0xaf91a986, n, kNumVariables);  // b"pool"
    samples.bottomLeftCorner(n, kNumVariables) =
        normal(0x97dfba65, n, kNumVariables);  // b"val"
    const int num_monomials = static_cast<int>(Exponents().rows());
    samples.rightCols(1) =
        Evaluate(normal(0x9ec960cf, num_monomials, 1),  // b"coeffs"
                 samples.leftCols(kNumVariables));
    return samples;
  };
  if (!MakeData(
          {num_samples, kNumColumns, kNumColumns}, generate, problem, error) ||
      !MakeRegression(/*ddof=*/0, problem, error)) {
    return false;
  }
  AddTargetNoise(noise, data_seed, problem);
  return true;
}

}  // namespace invgrad
