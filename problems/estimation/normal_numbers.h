// Independent normal numbers in a vector.
#ifndef PROBLEMS_ESTIMATION_NORMAL_NUMBERS_H_
#define PROBLEMS_ESTIMATION_NORMAL_NUMBERS_H_

#include "Eigen/Core"
#include "invgrad/io/numpy_random.h"

namespace invgrad {

// np.random.normal(size=size). For odd sizes the second number of the last pair
// is discarded.
inline Eigen::VectorXd NormalNumbers(int size, NumpyRandom* random) {
  Eigen::VectorXd numbers(size);
  for (int i = 0; i < size; i += 2) {
    const Eigen::Vector2d pair = random->NormalPair();
    numbers[i] = pair[0];
    if (i + 1 < size) numbers[i + 1] = pair[1];
  }
  return numbers;
}

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_NORMAL_NUMBERS_H_
