// The solution of an equation that is first order in time and periodic in
// space, as reference for networks.
//
//   u_t = A u + d^p/dx^p f(u),   p = 0 or 1,   u(t, x + 2) = u(t, x)
//
//   in Fourier modes U_k, k = pi m:  U' = a(k) U + (i k)^p F(f(u)),
//   by ETDRK4: the linear part exactly, the rest by a Runge-Kutta method of
//   order four, whose coefficients are means over a circle around a(k) h [1]
//
// Shapes:  u: N values on [-1, 1), x_j = -1 + 2 j / N.
// Cost:    four transforms of N values a time step.
// Errors:  of order h^4 in time, below every power of 1 / N in space if u is
//          smooth. Halve h and double N to see them.
// Fails:   never; values that are not finite propagate.
//
// [1] Kassam, Trefethen. Fourth-order time-stepping for stiff PDEs. SIAM J.
//     Sci. Comput. 26 (2005), equations 2.5 and 26 to 29 of Cox and Matthews
//     (2002).
#ifndef PROBLEMS_EQUATIONS_PERIODIC_EVOLUTION_H_
#define PROBLEMS_EQUATIONS_PERIODIC_EVOLUTION_H_

#include <complex>
#include <functional>

#include "Eigen/Core"

namespace invgrad {

struct PeriodicEvolution {
  std::function<std::complex<double>(double k)> linear;  // a
  std::function<double(double u)> nonlinear;             // f
  bool has_derivative = false;                           // p = 1
  int num_cells = 0;                                     // N
  double time_step = 0.0;                                // h, at most

  // u at points (t, x), 2 x number, for u(0, x) = start(x). t >= 0.
  Eigen::VectorXd Solve(const std::function<double(double x)>& start,
                        const Eigen::MatrixXd& points) const;
  // For u(0, x) = sum_m U_m exp(i pi m x), U_m = start(m), U_-m = conj(U_m). A
  // start with a kink is known better by its modes than by its values on a
  // grid.
  Eigen::VectorXd SolveByModes(
      const std::function<std::complex<double>(int m)>& start,
      const Eigen::MatrixXd& points) const;
};

}  // namespace invgrad

#endif  // PROBLEMS_EQUATIONS_PERIODIC_EVOLUTION_H_
