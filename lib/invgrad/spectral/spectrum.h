// The squared coefficients of a covector in the left singular vectors of J.
//
//   c_i^2 = (u_i . g)^2,   J = U S V^T,   lambda_i = s_i^2
//
// Shapes:  k = min(m, n) pairs (lambda_i, c_i^2), in any order. The m - k
//          directions outside the range of U have lambda = 0 and `outside` =
//          |g|^2 - sum_i c_i^2.
// Units:   lambda has those of J J^T, c_i^2 those of |g|^2.
#ifndef INVGRAD_SPECTRAL_SPECTRUM_H_
#define INVGRAD_SPECTRAL_SPECTRUM_H_

#include "Eigen/Core"

namespace invgrad {

struct Spectrum {
  Eigen::VectorXd lambda;
  Eigen::VectorXd squared_coefficients;
  Eigen::Index num_outside = 0;  // m - k
  double outside = 0.0;

  bool is_empty() const { return lambda.size() == 0; }
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_SPECTRUM_H_
