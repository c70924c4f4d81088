// The simulator, the data and the loss of `navier_stokes`: the velocity that
// moves a blob of marker to where it is seen later.
//
//   y = P(x; m_0) = m(T):  inviscid_flow.h, u(0) = x, m(0) = m_0
//
// Domain:  128 x 128, periodic, n x n cells (64: published); T = 2 in 8 steps.
// Shapes:  x: 2 n^2, x_x then x_y in the centres of the cells, row by row; y and
//          the context m_0: n^2.
// Prediction: x is averaged to the faces and projected, then simulated there.
// Data:    the truth is simulated with the velocity in the centres, from an
//          unprojected x*, as released: P(x*; m_0) is near y* and not y*.
// Facts:   both simulations agree with PhiFlow 2.2.7, with an exact pressure
//          solve there, to rounding. The release solves to 1e-4.
// Source:  Holl, Koltun, Thuerey, NeurIPS 2022, arXiv 2109.15048, and its code,
//          fluid/.
#ifndef PROBLEMS_NAVIER_STOKES_NAVIER_STOKES_H_
#define PROBLEMS_NAVIER_STOKES_NAVIER_STOKES_H_

#include <complex>
#include <memory>
#include <vector>

#include "Eigen/Core"
#include "invgrad/data.h"
#include "invgrad/field_simulator.h"
#include "invgrad/loss.h"
#include "invgrad/random.h"
#include "problems/fields/fourier_grid.h"
#include "problems/navier_stokes/inviscid_flow.h"

namespace invgrad {

struct NavierStokesSettings {
  static constexpr double kSide = 128.0;
  static constexpr double kTime = 2.0;
  static constexpr int kNumSteps = 8;
  static constexpr double kFluctuation = 0.1;  // deviation of a component of x*

  int cells = 64;  // a side

  double dx() const { return kSide / cells; }
  double courant() const { return kTime / kNumSteps / dx(); }
};

// Cost: y: 8 steps; Linearize: some 2.5 y; J v, J^T w: some y / 2 each; Adjoint,
//       which is Linearize and J^T w: some 3 y (bin/bench/field.cc).
//       Linearize keeps 360 bytes a cell and step: 12 MB at n = 64.
// Fails if y is not finite.
class NavierStokesSimulator final : public FieldSimulator {
 public:
  explicit NavierStokesSimulator(const NavierStokesSettings& settings);

  const NavierStokesSettings& settings() const { return settings_; }
  int num_inputs() const override { return 2 * num_outputs(); }
  int num_outputs() const override { return flow_.grid().num_cells(); }
  int num_context() const override { return num_outputs(); }
  bool Value(const double* x, const double* context, double* y) const override;
  std::unique_ptr<const JacobianOperator> Linearize(const double* x,
                                                    const double* context,
                                                    double* y) const override;

  // The state at the start, the velocity on faces.
  InviscidFlow::State Start(const double* x, const double* context) const;
  // The states at the 9 times, from the first one; and from the last one, by
  // time reversal: u -> -u, 8 steps, u -> -u. The marker is passive: marker and
  // velocity at the start do not depend on each other, only on their own ends.
  std::vector<InviscidFlow::State> Run(InviscidFlow::State first) const;
  std::vector<InviscidFlow::State> RunBack(InviscidFlow::State last) const;

 private:
  NavierStokesSettings settings_;
  InviscidFlow flow_;
};

// The distance of a blob's place and coarse shape:
//
//   L = sum_k sqrt(max(w_k^2 |F_k|^2, 1e-5)),   w_k = exp(-1/2 (80 |k| / 64)^2)
//
// with F the unnormalized Fourier transform of y - y*, without its mean, and k
// in waves across the box: the weights of the waves 1, 2, 3 are 0.46, 0.044,
// 9e-4. A perfect match has L = n^2 sqrt(1e-5). H_L >= 0, of which it gives
// products.
class CoarseShapeLoss final : public Loss {
 public:
  explicit CoarseShapeLoss(int cells);

  int size() const override { return grid_.num_cells(); }
  bool forms_hessian() const override { return false; }
  bool Evaluate(const double* y,
                const double* target,
                double* loss,
                double* gradient,
                double* hessian) const override;
  Eigen::VectorXd HessianTimes(const double* y,
                               const double* target,
                               const Eigen::VectorXd& v) const override;

 private:
  // F of y - y*, without its mean.
  Eigen::ArrayXcd Modes(const double* y, const double* target) const;
  // w |F| is above the floor.
  bool Counts(int mode, std::complex<double> F) const;

  FourierGrid grid_;
  Eigen::ArrayXd weights_;  // of every mode
  Eigen::ArrayXd counts_;   // 2 for a mode whose conjugate is not stored
};

// Fields (m_0, x*), one sample a column: 3 n^2 x num_samples.
//
// Each: c uniform in [32, 96]^2; m_0 = 1 in the `fill n^2` cells where
// RandomField in the box c +- 28 is greatest, and 0 elsewhere; `fill`, one
// number for the batch, uniform in [0.05, 0.15];
//   x* = (64 - com) / 2 + omega exp(-r^2 / (2 20^2)) (-r_y, r_x)
//        + 0.1 RandomField
// with com the centre of mass of m_0, r from (64, 64), omega uniform in
// [-2, 2].
// Stream: fill; for each sample c, the field of m_0, omega, those of x*_x, x*_y.
Eigen::MatrixXd RandomNavierStokesFields(const NavierStokesSettings& settings,
                                         int num_samples,
                                         NumpyRandom* random);

// Samples of fields (m_0, x*): inputs (m_0, y*), contexts m_0, targets y* after
// 8 steps in the centres, solutions x*. Targets that are not finite are
// reported by DataSet::IsFinite.
DataSet NavierStokesSamples(const NavierStokesSettings& settings,
                            const Eigen::MatrixXd& fields);

// The greatest dt |du_c / dx_d| of the velocities x* of `fields`: above 1 the
// look-ups of neighbouring cells cross, and the advection is no flow any more.
// The length of a look-up in cells has no such bound.
double GreatestDeformation(const NavierStokesSettings& settings,
                           const Eigen::MatrixXd& fields);

// A periodic field of standard deviation 1 and mean 0: white noise divided by
// k^2, without the modes of k^2 <= 0.1; k = 10 m / 128 for a mode of m waves.
Eigen::VectorXd RandomField(const FourierGrid& grid, NumpyRandom* random);

// The centre of mass of a marker, in units of the box. It does not know that
// the box is periodic: for blobs that do not cross its border.
Eigen::Vector2d CentreOfMass(const Eigen::VectorXd& marker,
                             const NavierStokesSettings& settings);

// The velocity `uniform` + omega exp(-r^2 / (2 20^2)) (-r_y, r_x): 2 n^2.
Eigen::VectorXd SwirlVelocity(const Eigen::Vector2d& uniform,
                              double omega,
                              const NavierStokesSettings& settings);

// mean over cells and samples of |x - x*|, the length of a vector; the
// fluctuations alone give 0.1 sqrt(pi / 2) = 0.125.
double MeanVelocityError(const Eigen::MatrixXd& x,
                         const Eigen::MatrixXd& solutions);

}  // namespace invgrad

#endif  // PROBLEMS_NAVIER_STOKES_NAVIER_STOKES_H_
