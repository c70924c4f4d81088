// Applies a spectral filter to a vector, given the tridiagonal form of a Gram
// matrix.
//
//   y = f(unit T) h over the eigenvalues above a cut,   f(lambda) = phi(s) / s,
//   lambda = s^2:   f(lambda) = (lambda + damping)^-Exponent()
//
// Shapes:  T: m x m;  h, y: m.
// Cost:    one contour integral: 70 to 130 solutions with T (tridiagonal.h),
//          one solution for Levenberg-Marquardt without a cut; each of four
//          perturbations adds half of that.
#ifndef INVGRAD_SPECTRAL_ROUTES_TRIDIAGONAL_FUNCTION_H_
#define INVGRAD_SPECTRAL_ROUTES_TRIDIAGONAL_FUNCTION_H_

#include <complex>

#include "invgrad/spectral/routes/spectral_buffers.h"
#include "invgrad/spectral/spectral_filter.h"

namespace invgrad {

// f in units of T: lambda / unit -> f(lambda) / Scale().
class GramFunction {
 public:
  // lambda_max: the largest eigenvalue of T.
  GramFunction(const SpectralFilter& filter, double unit, double lambda_max);

  std::complex<double> operator()(std::complex<double> z) const;

  // f has a pole or a branch point here, and is analytic above.
  double singularity() const { return -damping_; }
  // 1 / (z + damping), defined at roundings below zero too.
  bool is_damped_resolvent() const {
    return exponent_ == 1.0 && damping_ > 0.0;
  }
  double Scale() const { return scale_; }

 private:
  double exponent_;
  double damping_;
  double scale_;
};

// A threshold in T's spectrum. No eigenvalue lies between `below` and `above`.
struct Cut {
  int num_below = 0;      // number of dropped eigenvalues
  int num_undecided = 0;  // within `resolution` of the wanted threshold
  double below = 0.0;     // the largest dropped eigenvalue, or f's singularity
  double above = 0.0;     // the smallest kept eigenvalue
};

// The threshold nearest to `wanted` that lies in a gap of the spectrum:
// `wanted` itself, unless eigenvalues are within `resolution` of it.
Cut FindCut(const Tridiagonal& T,
            double wanted,
            double resolution,
            double singularity);

// buffers->y = f(T) h for the eigenvalues that `cut` keeps, 0 for the others; h
// is buffers->b. Returns the relative error of the step due to the backward
// error of the reduction. The step has the norm |sqrt(T) y| or, if
// `parameter_side`, |y|.
double ApplyCutFunction(const GramFunction& f,
                        double lambda_max,
                        const Cut& cut,
                        bool parameter_side,
                        SpectralBuffers* buffers);

// |sqrt(T) y|, or |y| if `parameter_side`.
double StepNorm(bool parameter_side,
                const Eigen::VectorXd& y,
                SpectralBuffers* buffers);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_TRIDIAGONAL_FUNCTION_H_
