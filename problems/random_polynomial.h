// A random polynomial of degree 4 in 6 variables, too complex for a small
// network to learn in full.
//
//   t(a) = sum_k c_k m_k(a),   m_k(a) = prod_j a_j^{p_kj} / sqrt(E_k)
//   E_k = prod_j (2 p_kj - 1)!!,   sum_j p_kj <= 4,   c_k, a_j standard normal
//
// E_k is the mean of the monomial's square, so that E[m_k^2] = 1.
//
// Network, loss, its scaling and the standardized target: regression.h.
//
// Shapes:  network 6-16-16-16-1, GELU, 673 weights;  x, y: 1;  c, m: 210.
// Data:    number for number those of the benchmark, which rounds a and y* to
//          single precision: c from
//          np.random.default_rng(seed("coeffs")).normal(size=210), a from those
//          of seed("pool") for training and of seed("val") for testing, with
//          seed(name) = (data_seed ^ zlib.crc32(name)) & 0x7fffffff. t is
//          standardized with 1 / N.
// Facts:   published losses on the same test samples: half-inverse,
//          half_inverse:step_size=0.1:truncation=1e-8, 0.084 +- 0.024 (15
//          seeds), Sven 0.139, Adam 0.238, SGD 0.318.
//          Here, by this half-inverse with shuffled batches: 0.06 to 0.21,
//          median 0.095 (seeds 1 to 15); by
//          half_inverse:step_size=0.12:schedule=cosine 0.079 to 0.110, median
//          0.088. Losses are 1.2 to 1.5 times as large if batches are not
//          shuffled.
// Source:  the Sven benchmark, random polynomial; arXiv 2604.01279.
#ifndef PROBLEMS_RANDOM_POLYNOMIAL_H_
#define PROBLEMS_RANDOM_POLYNOMIAL_H_

#include <string>

#include "Eigen/Core"
#include "problems/problem.h"
#include "problems/sample_data.h"

namespace invgrad {

struct RandomPolynomial {
  static constexpr int kNumVariables = 6;
  static constexpr int kDegree = 4;

  struct Options {
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
  };

  // `data`: a and t, one sample a row.
  static bool Create(const Options& options,
                     const Eigen::MatrixXd* data,
                     LearningProblem* problem,
                     std::string* error);

  // p: 210 x 6, the monomials of degree 0 first, then those of degree 1, ..; of
  // one degree in the order of Python's
  // itertools.combinations_with_replacement(range(6), degree).
  static Eigen::MatrixXi Exponents();

  // t(a) of every row a of `inputs` (N x 6), with the coefficients c (210).
  static Eigen::VectorXd Evaluate(const Eigen::VectorXd& c,
                                  const Eigen::MatrixXd& inputs);
};

}  // namespace invgrad

#endif  // PROBLEMS_RANDOM_POLYNOMIAL_H_
