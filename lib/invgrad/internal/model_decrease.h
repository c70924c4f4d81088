// Whether a state is a minimum, whatever the units of the parameters: how much of
// the cost the linear model takes away there.
//
//   (L(x) - min_step 1/2 |r + J step|^2) / L(x) = |U^T c|^2 / |r|^2
//   J = Q R,   c = Q^T r,   R D^-1 = U S V^T,   D = diag(|R e_i|)
//
// of the s > threshold s_max. It is the squared cosine of the angle between r and
// the range of J, 0 at a minimum. Ceres' tolerances can be met far from one:
// those for the change of the cost and for the step where a parameter has made
// its own column short, or the trust region is small; that for the gradient,
// which has a unit, where the residuals are small.
//
//   double decrease = RelativeModelDecrease(
//       function_tolerance, parameter_tolerance, R, c, x, squared_norm);
//   bool is_minimum = decrease == 0.0;
//
// A decrease of at most max(1e-5, 10 function_tolerance, parameter_tolerance)
// counts as none.
// A step that changes each r by less than 1e-8 of what the parameters themselves
// do, |U^T c| <= 1e-8 |D x|, counts as none: where r vanishes, its direction is
// that of rounding errors.
//
// Shapes:  R: N x N, of which the upper triangle is read;  c, x: N.
// Cost:    N^2 operations at a minimum, otherwise an SVD of N x N.
#ifndef INVGRAD_INTERNAL_MODEL_DECREASE_H_
#define INVGRAD_INTERNAL_MODEL_DECREASE_H_

#include <algorithm>
#include <cmath>
#include <string>

#include "Eigen/Core"
#include "Eigen/SVD"

namespace invgrad {

// Whether the residuals have vanished: their direction is that of rounding errors.
inline bool HasVanished(double cost, double first_cost) {
  return cost <= 1e-16 * first_cost;
}

template <typename Matrix, typename Vector>
double RelativeModelDecrease(double function_tolerance,
                             double parameter_tolerance,
                             const Matrix& R,
                             const Vector& c,
                             const Vector& x,
                             double squared_norm) {
  const double least_decrease =
      std::max({1e-5, 10.0 * function_tolerance, parameter_tolerance});
  constexpr double kLeastStep = 1e-8;
  constexpr double kThreshold = 1e-7;
  Matrix A = R.template triangularView<Eigen::Upper>();
  const Vector lengths = A.colwise().norm().transpose();
  const double least =
      std::max(least_decrease * squared_norm,
               kLeastStep * kLeastStep * lengths.cwiseProduct(x).squaredNorm());
  if (!(c.squaredNorm() > least)) return 0.0;
  for (Eigen::Index j = 0; j < A.cols(); ++j) {
    if (lengths[j] > 0.0) A.col(j) /= lengths[j];
  }
  const Eigen::JacobiSVD<Matrix> svd(A, Eigen::ComputeFullU);
  double decrease = 0.0;
  for (Eigen::Index i = 0; i < c.size(); ++i) {
    if (svd.singularValues()[i] <= kThreshold * svd.singularValues()[0]) break;
    decrease += std::pow(svd.matrixU().col(i).dot(c), 2);
  }
  return decrease > least ? decrease / squared_norm : 0.0;
}

// "; no minimum: the linear model predicts that the cost falls by 12 %", or "" if
// the decrease is 0.
std::string NoMinimumText(double decrease);

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_MODEL_DECREASE_H_
