// The ways to compute V phi(S) U^T g among which SpectralStep chooses, and what
// they share. See spectral_step.h for what they promise.
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

// Where phi jumps, in units of s_max: at tau, or at zero if phi does not vanish
// there. Negative if phi is continuous.
double JumpOf(const SpectralFilter& filter);

// Fills what the summary says about known singular values. Values of
// (s / s_max)^power within `resolution` of the jump are undecided.
void SummarizeSpectrum(const SpectralFilter& filter,
                       const Eigen::VectorXd& s,
                       double s_max,
                       int power,
                       double resolution,
                       SpectralStepSummary* summary);

// True if J has no entry that is infinite or NaN; otherwise the message names
// the first row that has one.
bool CheckJacobianFinite(const JacobianOperator& J, std::string* message);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_SPECTRAL_ROUTES_H_
