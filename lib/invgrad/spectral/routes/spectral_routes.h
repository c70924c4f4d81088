// The routes of SpectralStep to V phi(S) U^T g, and their common functions.
// spectral_step.h states their contract.
//
// Each route returns false with summary->message set if it fails, and fills
// *summary otherwise; g is finite.
#ifndef INVGRAD_SPECTRAL_ROUTES_SPECTRAL_ROUTES_H_
#define INVGRAD_SPECTRAL_ROUTES_SPECTRAL_ROUTES_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/core/jacobian_operator.h"
#include "invgrad/spectral/spectral_filter.h"
#include "invgrad/spectral/spectral_step.h"

namespace invgrad {

struct SpectralProblem {
  const JacobianOperator& J;
  const Eigen::VectorXd& g;
  const SpectralFilter& filter;

  Eigen::Index m() const { return J.rows(); }
  Eigen::Index n() const { return J.cols(); }
};

bool GramRoute(const SpectralProblem& problem,
               SpectralBuffers* buffers,
               Eigen::VectorXd* d,
               SpectralStepSummary* summary);

bool SvdRoute(const SpectralProblem& problem,
              SpectralBuffers* buffers,
              Eigen::VectorXd* d,
              SpectralStepSummary* summary);

bool GradientRoute(const SpectralProblem& problem,
                   Eigen::VectorXd* d,
                   SpectralStepSummary* summary);

// The jump of phi, in units of s_max: tau, or zero if phi does not vanish at
// zero. Negative if phi is continuous.
double JumpOf(const SpectralFilter& filter);

// Fills the summary's fields about known singular values. Values of
// (s / s_max)^power within `resolution` of the jump are undecided.
void SummarizeSpectrum(const SpectralFilter& filter,
                       const Eigen::VectorXd& s,
                       double s_max,
                       int power,
                       double resolution,
                       SpectralStepSummary* summary);

// True if all entries of J are finite; otherwise the message names the first
// row with an infinite or NaN entry.
bool CheckJacobianFinite(const JacobianOperator& J, std::string* message);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_SPECTRAL_ROUTES_H_
