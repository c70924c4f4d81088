// The random stream of numpy's Generator, number for number.
//
//   rng = np.random.default_rng(seed);  rng.random();  rng.standard_normal()
//
// SeedSequence hashes the seed into the state of PCG64 (XSL-RR 128/64 [1]);
// doubles are its top 53 bits / 2^53. Normal numbers come from a ziggurat of
// 256 layers [2]; 99 of 100 take one draw, the others a variable number.
//
// Source: numpy/random/bit_generator.pyx, src/pcg64/pcg64.h and
// src/distributions/distributions.c, numpy 1.17 and later. numpy does not
// guarantee this stream, but has not changed it so far.
//
// [1] O'Neill. PCG: A Family of Simple Fast Space-Efficient Statistically Good
//     Algorithms for Random Number Generation. Harvey Mudd College,
//     HMC-CS-2014-0905, 2014.
// [2] Marsaglia, Tsang. The Ziggurat Method for Generating Random Variables.
//     Journal of Statistical Software 5(8), 2000.
#ifndef INVGRAD_IO_NUMPY_GENERATOR_H_
#define INVGRAD_IO_NUMPY_GENERATOR_H_

#include <cstdint>

#include "Eigen/Core"

namespace invgrad {

class NumpyGenerator {
 public:
  // np.random.default_rng(seed)
  explicit NumpyGenerator(std::uint32_t seed);

  // rng.random(): [0, 1).
  double Random();

  // rng.standard_normal()
  double StandardNormal();

  // rng.standard_normal((rows, cols)), filled row by row, as numpy does; the
  // same as rng.normal(size=(rows, cols)).
  Eigen::MatrixXd StandardNormal(int rows, int cols);

 private:
  __extension__ typedef unsigned __int128 Word;  // not ISO C++

  void Advance();
  std::uint64_t Next();

  Word state_ = 0;
  Word increment_;
};

}  // namespace invgrad

#endif  // INVGRAD_IO_NUMPY_GENERATOR_H_
