// Estimates from the coefficients of the loss gradient how much of them is noise.
//
//   c_i = u_i . g,   E c_i^2 = K (x_i^a + noise),   x_i = lambda_i / lambda_max
//
// The signal grows with the eigenvalue lambda_i of J J^T, by a power law; the
// noise is the same for all of them. Fit finds K, a and noise of the largest
// likelihood for normal c_i, by a search over a in {1/2, 3/4, 1} and noise in
// 10^{-20, -19.75, ... 3}, K in closed form. The Wiener filter of this model,
// x^a / (x^a + noise), is part of SpectralFilter.
//
// What a batch cannot tell apart: noise in the targets, and a residual that is
// not fitted yet with a spectrum as flat as noise. The rule decides by the trend
// of the loss (fresh_control.h).
//
// Data:    the squared coefficients of the last spectra, relative to their mean,
//          in bins of lambda / lambda_max: two for each factor e, down to
//          e^-32, and one below. An observation has the weight 0.77^k after k
//          others.
// Cost:    Fit: at most 18,000 logarithms.
// Source:  empirical Bayes, as in Bayesian regularization (MacKay. Bayesian
//          interpolation. Neural Computation 4 (1992)), where a = 1.
#ifndef INVGRAD_RULES_EVIDENCE_H_
#define INVGRAD_RULES_EVIDENCE_H_

#include "Eigen/Core"
#include "invgrad/spectral.h"

namespace invgrad {

class Evidence {
 public:
  struct Model {
    double signal_exponent = 1.0;  // a
    double noise = 0.0;            // in units of the largest signal
  };

  // Ignores an empty spectrum and one without coefficients.
  void Add(const Spectrum& spectrum);

  // Without noise before the first spectrum.
  Model Fit() const;

  Eigen::VectorXd* mutable_state() { return &state_; }

 private:
  Eigen::VectorXd state_;  // the bins' counts, then their sums; may be empty
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_EVIDENCE_H_
