// The inverse of `navier_stokes` by time reversal: one number a sample.
//
//   x = uniform(m_0) + swirl(omega_0 + d_omega)
//
// The family of the answers is that of the data without their fluctuations: a
// uniform velocity that carries the blob to the middle, known from m_0, and a
// swirl about the middle of known shape (SwirlVelocity). omega_0 is the
// projection of x_now on the swirl. d_omega comes from the flow run backwards:
//
//   C_t   the centres of mass of the marker from (m_0, x_now), t = 0 .. 8
//   R_t   those of the flow run back from (y, the last velocity of that run):
//         NavierStokesSimulator::RunBack
//   d_omega = 1e-3 mean_t (C_t - R_t) x (R_t - S_t)
//
// with S_t, the way of the swirl's middle: 64 + (64 - com(m_0)) t / 8.
//
// Release: it has the factors 1, then (7 - i) / 2 for the reverse steps i = 0 ..
//          7 in place of (7 - i) / 8: T where the number of steps is meant.
//          `Way::kReleased` has them, and kStraight t / 8. The release
//          divides the projection by 120.5; here it is divided by the mean of
//          r^2 exp(-r^2 / 800) over the cells, so that a swirl is found exactly.
// General: RunBack reverses a whole state, marker and velocity, with the errors
//          of the advection. It is no inverse in x where only the marker is
//          seen: the marker is passive, and the velocity that comes back is the
//          one that was there. The least change of x that corrects the marker is
//          the way `lbfgs` (simulator_pull_back.h).
// Shapes:  y and the context m_0: n^2; x, x_now: 2 n^2. y is the marker that is
//          wanted at T.
// Facts:   from the right uniform velocity without a swirl, on random samples,
//          mean |omega - omega*| is 1.1 at first, 0.9 (kReleased: 0.7) after
//          one inverse and 0.2 after twenty at n = 64; 0.1 (0.04) at n = 32.
// Cost:    two simulations.
// Fails:   Invert returns false if a marker is empty or a state is not finite.
//          P(x) = y does not hold: reaches_target() is false. Centres of mass
//          do not know that the box is periodic.
// Source:  as navier_stokes.h.
#ifndef PROBLEMS_NAVIER_STOKES_TIME_REVERSAL_H_
#define PROBLEMS_NAVIER_STOKES_TIME_REVERSAL_H_

#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/inverse_simulator.h"
#include "problems/navier_stokes/navier_stokes.h"

namespace invgrad {

class TimeReversal final : public InverseSimulator {
 public:
  enum class Way { kStraight, kReleased };

  TimeReversal(std::shared_ptr<const NavierStokesSimulator> simulator, Way way);

  bool Invert(const ConstVectorRef& y,
              const ConstVectorRef& x_now,
              const ConstVectorRef& context,
              Eigen::VectorXd* x,
              std::string* why) const override;
  bool reaches_target() const override { return false; }

  // omega_0.
  double SwirlStrength(const Eigen::VectorXd& x) const;

 private:
  std::shared_ptr<const NavierStokesSimulator> simulator_;
  Way way_;
  Eigen::VectorXd unit_swirl_;  // (-r_y, r_x) / the sum of r^2 exp(...)
};

}  // namespace invgrad

#endif  // PROBLEMS_NAVIER_STOKES_TIME_REVERSAL_H_
