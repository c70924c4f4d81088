#include "problems/regression_1d.h"

#include <cmath>
#include <cstdint>

#include "invgrad/io/numpy_random.h"
#include "problems/regression.h"
#include "problems/sample_data.h"

namespace invgrad {

double Regression1d::Target(double a) {
  return std::exp(-10.0 * a * a) * std::sin(2.0 * a);
}

bool Regression1d::Create(const Options& options,
                          const Eigen::MatrixXd* data,
                          LearningProblem* problem,
                          std::string* error) {
  // The array is copied once.
  if (!CheckDataMemory(data, options.num_samples, 4, 2, "", error)) {
    return false;
  }
  Eigen::MatrixXd samples;
  if (data != nullptr) {
    if (!CheckDataShape(*data, 2, error)) return false;
    samples = *data;
  } else {
    samples.resize(2 * options.num_samples, 2);
    NumpyRandom random(static_cast<std::uint32_t>(options.data_seed));
    for (auto sample : samples.rowwise()) {
      sample[0] = 2.0 * random.Rand() - 1.0;
      sample[1] = Target(sample[0]);
    }
  }
  if (!MakeRegression(samples, Variance::kUnbiased, problem, error))
    return false;
  AddTargetNoise(options.noise, options.data_seed, problem);
  return true;
}

}  // namespace invgrad
