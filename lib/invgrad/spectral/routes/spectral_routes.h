// The ways to compute V phi(S) U^T g that SpectralStep chooses from; not for
// other callers. See spectral_step.h for what they compute and promise.
//
// Each returns false with summary->message set if it fails, and fills *summary
// otherwise; g is finite.
#ifndef INVGRAD_SPECTRAL_ROUTES_SPECTRAL_ROUTES_H_
#define INVGRAD_SPECTRAL_ROUTES_SPECTRAL_ROUTES_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/core/jacobian_operator.h"
#include "invgrad/spectral/spectral_filter.h"
#include "invgrad/spectral/spectral_step.h"
#include "invgrad/spectral/spectral_workspace.h"

namespace invgrad {

struct SpectralProblem {
  const JacobianOperator& J;
  const Eigen::VectorXd& g;
  const SpectralFilter& filter;

  Eigen::Index m() const { return J.rows(); }
  Eigen::Index n() const { return J.cols(); }
};

// Where phi jumps, in units of s_max: at tau, or at zero if phi does not vanish
// there. Negative if phi is continuous.
double JumpOf(const SpectralFilter& filter);

// How near to the jump a value is undecided: of s / s_max after an SVD, of
// (s / s_max)^2 by a Gram matrix of that size.
double SvdResolution(Eigen::Index m, Eigen::Index n);
double GramResolution(Eigen::Index size, Eigen::Index other_size);

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

bool GradientRoute(const SpectralProblem& problem,
                   Eigen::VectorXd* d,
                   SpectralStepSummary* summary);

bool SvdRoute(const SpectralProblem& problem,
              SpectralWorkspace* workspace,
              Eigen::VectorXd* d,
              SpectralStepSummary* summary);

// By J J^T (kGram) or J^T J (kParameterGram).
bool GramRoute(const SpectralProblem& problem,
               SpectralRoute route,
               SpectralWorkspace* workspace,
               Eigen::VectorXd* d,
               SpectralStepSummary* summary);

// True if GramRoute reduces the Gram matrix to tridiagonal form, from which
// CascadeRoute can go on.
bool GramIsReduced(const SpectralProblem& problem);

bool GolubKahanRoute(const SpectralProblem& problem,
                     double tolerance,
                     double memory_limit,
                     SpectralWorkspace* workspace,
                     Eigen::VectorXd* d,
                     SpectralStepSummary* summary);

// True if the filter is damped and not truncated, and J is stored in rows.
bool IsForCholesky(const SpectralProblem& problem);

bool CholeskyRoute(const SpectralProblem& problem,
                   double tolerance,
                   double memory_limit,
                   SpectralWorkspace* workspace,
                   Eigen::VectorXd* d,
                   SpectralStepSummary* summary);

// Values below a split, chosen so that the large ones' error is well below
// `tolerance`, are left to an SVD.
// `reduced`: GramRoute has just left its reduction in *workspace, in one stage.
bool CascadeRoute(const SpectralProblem& problem,
                  double tolerance,
                  bool reduced,
                  SpectralWorkspace* workspace,
                  Eigen::VectorXd* d,
                  SpectralStepSummary* summary);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_SPECTRAL_ROUTES_H_
