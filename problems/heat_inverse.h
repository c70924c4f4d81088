// An inverse of diffusion that only amplifies modes that are more likely signal
// than noise.
//
//   x = x_0 + F^-1(exp(alpha_k nu t |k|^2) D_k),   D = F(y - P(x_0))
//
//   p_k = s_k / (s_k + n_k), the probability that D_k is signal:
//     s_k = exp(-1/2 (|D_k| / e_k)^2),   e_k = sqrt(N) exp(-nu t |k|^2)
//     n_k = exp(-1/2 (|D_k| / u)^2),     u = |r |y - P(x_0)| + a|_2
//   alpha_k = 0           for 1/2 < p_k < 0.68 (less than one sigma)
//             2 p_k - 1   otherwise
//
// e_k is the amplitude in y of white noise of variance one in x; u is the
// uncertainty of a mode for an uncertainty r |dy| + a of each cell. alpha = 1
// is the exact inverse, alpha = 0 leaves a mode unchanged, alpha = -1 diffuses
// it once more.
//
// Shapes:  x, x_0, y: the cells of the grid.
// Units:   a has the units of y; r is a number.
// Cost:    four transforms.
// Facts:   no mode with |D_k| < 1.22 u is amplified, and none by more than
//          sqrt(N) / u, so noise in y cannot dominate x. If e_k <= u, a mode
//          changes by at most |D_k|. u shrinks with y - P(x_0), down to
//          a sqrt(N), so a second step from the new x restores more modes.
// Fails:   Invert returns false if an input is not finite. Sizes that do not
//          fit, and a < 1e-100 or r < 0, are CHECKed.
//
// Source: PBDL, chapter physgrad-code, inv_diffuse and apply_damping, and the
//         code of Holl, Koltun, Thuerey, NeurIPS 2022, heat/inv_diffuse.py.
//         There p_k = 0 if s_k and n_k both underflow, and the exponent is cut
//         off at 88; here the ratio does not underflow, and the bound above
//         makes a cut-off unnecessary. There e_k has the length of a side in
//         place of sqrt(N), the same in two dimensions.
#ifndef PROBLEMS_HEAT_INVERSE_H_
#define PROBLEMS_HEAT_INVERSE_H_

#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/inverse_simulator.h"
#include "problems/spectral_diffusion.h"

namespace invgrad {

// The uncertainty of y in one cell is relative |dy| + absolute.
struct HeatUncertainty {
  static constexpr double kMinAbsolute = 1e-100;  // its square is not zero
  double relative = 1e-6;
  double absolute = 1e-8;
};

class HeatInverse final : public InverseSimulator {
 public:
  HeatInverse(std::shared_ptr<const SpectralDiffusion> simulator,
              const HeatUncertainty& uncertainty);

  bool Invert(const ConstVectorRef& y,
              const ConstVectorRef& x0,
              const ConstVectorRef& context,
              Eigen::VectorXd* x,
              std::string* why) const override;

  // Damped modes stay where they were.
  bool reaches_target() const override { return false; }

  // alpha_k for |D_k|, e_k and u.
  static double Action(double amplitude, double expected, double uncertainty);

 private:
  std::shared_ptr<const SpectralDiffusion> simulator_;
  HeatUncertainty uncertainty_;
};

}  // namespace invgrad

#endif  // PROBLEMS_HEAT_INVERSE_H_
