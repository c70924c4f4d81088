#include "problems/target_noise.h"

#include <cmath>
#include <cstdint>

#include "invgrad/io/numpy_random.h"

namespace invgrad {

void DescribeTargetNoise(double* noise, OptionSet* set) {
  set->Add("noise",
           noise,
           {0.0, 1e6},
           "deviation of noise in the training targets, over their root mean "
           "square");
}

void AddTargetNoise(double noise, int data_seed, LearningProblem* problem) {
  if (noise == 0.0) return;
  Eigen::MatrixXd& targets = problem->train.targets;
  const double deviation =
      noise *
      std::sqrt(targets.squaredNorm() / static_cast<double>(targets.size()));
  NumpyRandom random(static_cast<std::uint32_t>(data_seed) ^ 0x9e3779b9U);
  for (Eigen::Index i = 0; i < targets.size(); i += 2) {
    const Eigen::Vector2d z = random.NormalPair();
    targets.data()[i] += deviation * z[0];
    if (i + 1 < targets.size()) targets.data()[i + 1] += deviation * z[1];
  }
}

}  // namespace invgrad
