// The regression problems of the Sven benchmark: a network without a simulator.
//
//   y = x = f(a),   L = |y - y*|^2,   y* = (t(a) - mean t) / std t
//
// over the training targets.
//
//   Regression1d       t(a) = exp(-10 a^2) sin 2a,   a uniform in [-1, 1)
//   RandomPolynomial   t(a) = sum_k c_k m_k(a),   c_k, a_j standard normal
//     m_k(a) = prod_j a_j^{p_kj} / sqrt(E_k),   j = 1 .. 6,   sum_j p_kj <= 4
//     E_k = prod_j (2 p_kj - 1)!!, the mean of the monomial's square
//
// The first is easy, to compare the accuracy of rules; the second is too
// complex for a small network to learn in full.
//
// Shapes:  network |a|-16-16-16-1, GELU, PyTorch's initialization: 593 weights
//          for |a| = 1, 673 for |a| = 6;  x, y: 1;  c, m: 210.
// Units:   the loss of a batch is the sum of the samples' losses, not their
//          mean, so g = 2 (y - y*), as in the benchmark: its half-inverse
//          with learning rate lr and truncation tau is here
//          half_inverse:step_size=lr:truncation=tau. Gradients are B times
//          those of the mean. Losses are still reported as means.
// Settings: B 32, 20 epochs, of which the last, incomplete batch is left out.
//          The benchmark shuffles its batches.
// Data:    Regression1d: np.random.seed(data_seed);
//          a = 2 np.random.rand(2 N) - 1, the first N for training; std with
//          1 / (N - 1). The benchmark draws a from the same distribution by
//          PyTorch's generator, in single precision.
//          RandomPolynomial: number for number those of the benchmark, which
//          rounds a and y* to single precision: c from
//          np.random.default_rng(seed("coeffs")).normal(size=210), a from those
//          of seed("pool") for training and of seed("val") for testing, with
//          seed(name) = (data_seed ^ zlib.crc32(name)) & 0x7fffffff. std with
//          1 / N.
// Facts:   published losses, and those of this half-inverse here, with shuffled
//          batches (seeds 1 to 15):
//          Regression1d: half_inverse:step_size=0.005:truncation=1e-6
//          1.8e-9 +- 1.0e-9, here 0.9e-9 to 10e-9, median 3.1e-9; Sven 5.1e-7,
//          Adam 3.3e-5, SGD 1.1e-3. t is odd. The samples are points of a line,
//          so J of a batch of 32 is singular: at the start its singular values
//          fall from 7 to 2e-6 at the ninth. The minimizer of the batch's linear
//          model is far outside of the model's range of validity, so the
//          half-inverse needs a small, fixed step size.
//          RandomPolynomial: half_inverse:step_size=0.1:truncation=1e-8
//          0.084 +- 0.024, here 0.06 to 0.21, median 0.095; Sven 0.139, Adam
//          0.238, SGD 0.318. half_inverse:step_size=0.12:schedule=cosine here
//          0.079 to 0.110, median 0.088. Losses are 1.2 to 1.5 times as large
//          if batches are not shuffled.
// Source:  the Sven benchmark, sambt/sven-experiments,
//          experiments/datasets/all_datasets.py and optimizers/hig.py;
//          arXiv 2604.01279.
#ifndef PROBLEMS_REGRESSION_H_
#define PROBLEMS_REGRESSION_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/compare/sample_data.h"

namespace invgrad {

// `data` of both: a and t, one sample a row.
struct Regression1d {
  int num_samples = 10000;
  int data_seed = 0;
  double noise = 0.0;
  void Describe(OptionSet* set) {
    DescribeSamples(2, 1e7, &num_samples, &data_seed, set);
    DescribeTargetNoise(&noise, set);
  }

  bool Create(LearningProblem* problem, std::string* error) const;

  // t(a).
  static double Target(double a);
};

struct RandomPolynomial {
  static constexpr int kNumVariables = 6;
  static constexpr int kDegree = 4;

  int num_samples = 10000;
  int data_seed = 57728;
  double noise = 0.0;
  void Describe(OptionSet* set) {
    set->Add("num_samples",
             &num_samples,
             {2, 1e7},
             "training samples; as many again are for testing");
    set->Add("data_seed",
             &data_seed,
             {0, 2147483647},
             "what the seeds of c and a are made from");
    DescribeTargetNoise(&noise, set);
  }

  bool Create(LearningProblem* problem, std::string* error) const;

  // p: 210 x 6, the monomials of degree 0 first, then those of degree 1, ..; of
  // one degree in the order of Python's
  // itertools.combinations_with_replacement(range(6), degree).
  static Eigen::MatrixXi Exponents();

  // t(a) of every row a of `inputs` (N x 6), with the coefficients c (210).
  static Eigen::VectorXd Evaluate(const Eigen::VectorXd& c,
                                  const Eigen::MatrixXd& inputs);
};

}  // namespace invgrad

#endif  // PROBLEMS_REGRESSION_H_
