// The random stream of numpy's legacy generator, number for number.
//
//   np.random.seed(seed);  np.random.rand(...);  np.random.permutation(n)
//
// MT19937; doubles have 53 bits: (a * 2^26 + b) / 2^53 with a, b the top 27 and
// 26 bits of two draws. Normal numbers come from Marsaglia's polar method.
//
// Source: numpy/random/src/legacy/legacy-distributions.c and
// numpy/random/mtrand.pyx (shuffle), numpy 1.x and 2.x.
#ifndef INVGRAD_RANDOM_H_
#define INVGRAD_RANDOM_H_

#include <cstdint>
#include <random>
#include <vector>

#include "Eigen/Core"

namespace invgrad {

class NumpyRandom {
 public:
  // np.random.seed(seed)
  explicit NumpyRandom(std::uint32_t seed) : generator_(seed) {}

  // np.random.rand(): [0, 1).
  double Rand();

  // np.random.rand(rows, cols), filled row by row, as numpy does.
  Eigen::MatrixXd Rand(int rows, int cols);

  // np.random.uniform(low, high)
  double Uniform(double low, double high);

  // np.random.normal(), twice. numpy draws normal numbers in pairs and stores
  // the second for the next call; drawing a pair leaves nothing to store.
  Eigen::Vector2d NormalPair();

  // np.random.normal(size=size). For odd sizes the second number of the last
  // pair is discarded.
  Eigen::VectorXd Normal(int size);

  // np.random.permutation(n)
  std::vector<int> Permutation(int n);

  // The state of the generator, 625 integers, for checkpoints. SetState returns
  // false, and changes nothing, if the values are no state.
  Eigen::VectorXd State() const;
  bool SetState(const Eigen::VectorXd& state);

 private:
  std::mt19937 generator_;
};

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

#endif  // INVGRAD_RANDOM_H_
