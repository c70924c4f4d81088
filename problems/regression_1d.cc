#include "problems/regression_1d.h"

#include <cmath>

#include "problems/regression.h"

namespace invgrad {

double Regression1d::Target(double a) {
  return std::exp(-10.0 * a * a) * std::sin(2.0 * a);
}

bool Regression1d::Create(const Options& options,
                          const Eigen::MatrixXd* data,
                          LearningProblem* problem,
                          std::string* error) {
  const auto generate = [&options](int num_rows) {
    Eigen::MatrixXd samples(num_rows, 2);
    samples.col(0) = UniformData(-1.0, 1.0, num_rows, 1, options.data_seed);
    samples.col(1) = samples.col(0).unaryExpr(&Target);
    return samples;
  };
  if (!MakeData(
          {options.num_samples, 2, 2.0, ""}, data, generate, problem, error) ||
      !MakeRegression(Variance::kUnbiased, problem, error)) {
    return false;
  }
  AddTargetNoise(options.noise, options.data_seed, problem);
  return true;
}

}  // namespace invgrad
