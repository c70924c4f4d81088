// The routes of SpectralStep to V phi(S) U^T g, and their common functions.
// spectral.h states their contract.
//
// Each route returns false with summary->message set if it fails, and fills
// *summary otherwise; g is finite.
#ifndef INVGRAD_SPECTRAL_ROUTES_SPECTRAL_ROUTES_H_
#define INVGRAD_SPECTRAL_ROUTES_SPECTRAL_ROUTES_H_

#include <complex>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/dense_svd.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/spectral.h"
#include "invgrad/spectral/routes/contour_quadrature.h"
#include "invgrad/spectral/routes/tridiagonal.h"
#include "invgrad/spectral/routes/tridiagonalization.h"

namespace invgrad {

// The arrays that the routes keep from one step to the next.
struct SpectralBuffers {
  // Route gram: J J^T or J^T J, divided by `unit`, in the columns of `strips`;
  // later the reflectors of the reduction, or the eigenvectors.
  Eigen::MatrixXd gram;
  ColumnStrips strips{0, nullptr};
  double unit = 1.0;
  Eigen::VectorXd b;  // the argument of f(K) b
  Eigen::VectorXd y;
  Eigen::VectorXd product;
  Tridiagonalization reduction;
  Tridiagonal tridiagonal;
  Tridiagonal::Perturbations perturbations;
  Tridiagonal::Changes changes;
  Eigen::VectorXd change;
  // The diagonal of the Gram matrix; later all eigenvalues, if computed.
  Eigen::VectorXd values;
  std::vector<ContourNode> nodes;
  std::vector<std::complex<double>> shifts;
  std::vector<std::complex<double>> coefficients;

  // Route svd.
  Eigen::MatrixXd dense;
  DenseSvd svd;
};

// The arguments of a route.
struct SpectralProblem {
  const JacobianOperator& J;
  const Eigen::VectorXd& g;
  const SpectralFilter& filter;
  SpectralBuffers* buffers;
  Eigen::VectorXd* d;
  SpectralStepSummary* summary;

  Eigen::Index m() const { return J.rows(); }
  Eigen::Index n() const { return J.cols(); }
  // Route gram uses J^T J in place of J J^T.
  bool parameter_side() const { return n() < m(); }
};

bool GramRoute(const SpectralProblem& problem);
bool SvdRoute(const SpectralProblem& problem);

// The jump of phi, in units of s_max: tau, or zero if phi does not vanish at
// zero. Negative if phi is continuous.
double JumpOf(const SpectralFilter& filter);

// Fills the summary's fields about known singular values. Values of
// (s / s_max)^power within `resolution` of the jump are undecided.
void SummarizeSpectrum(const SpectralProblem& problem,
                       const Eigen::VectorXd& s,
                       double s_max,
                       int power,
                       double resolution);

// True if all entries of J are finite; otherwise the message names the first
// row with an infinite or NaN entry.
bool CheckJacobianFinite(const JacobianOperator& J, std::string* message);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_SPECTRAL_ROUTES_H_
