// One explicit step of diffusion on a periodic line.
//
//   y_i = f_i + a (f_{i-1} - 2 f_i + f_{i+1}),   a = nu dt / dx^2
//
// Facts:   linear and symmetric: the tangent and the adjoint are the function
//          itself; the mean is conserved; stable for a <= 1/2; order 2 in dx, 1
//          in dt.
#ifndef PROBLEMS_FIELDS_DIFFUSION_H_
#define PROBLEMS_FIELDS_DIFFUSION_H_

#include "Eigen/Core"

namespace invgrad {

inline Eigen::VectorXd DiffuseExplicitly(const Eigen::VectorXd& f, double a) {
  const Eigen::Index n = f.size();
  Eigen::VectorXd y(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    y[i] = f[i] + a * (f[(i + n - 1) % n] - 2.0 * f[i] + f[(i + 1) % n]);
  }
  return y;
}

}  // namespace invgrad

#endif  // PROBLEMS_FIELDS_DIFFUSION_H_
