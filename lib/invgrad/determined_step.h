// Computes a Gauss-Newton step that leaves alone the directions that the
// residuals do not determine. Use it in an estimation loop of your own with a
// few unknowns, such as the 6 of a pose. Inside ceres::Solve use the rule
// `determined` (rules.h). To name such directions use rank_report.h.
//
//   H = J^T J,   A = J D^-1,   A^T A = D^-1 H D^-1 = V diag(s^2) V^T
//   left alone  s <= tau s_max
//   step        = -D^-1 K (K^T A^T A K)^-1 K^T D^-1 gradient
//
// D scales the unknowns. Unknowns that have one unit and one coordinate frame
// form a group, and D is the root mean square column length of the group:
//
//   D_i^2 = sum of H_jj over the group of i / number of its unknowns
//
// so that the s^2 have the mean 1. K is an orthonormal basis of the directions
// that are not left alone: D step is orthogonal to each left-alone v, so of all
// steps with the same effect on the kept directions it is the shortest in the
// metric D^2. A left-alone v is the motion D^-1 v.
//
// Groups. One unknown each (the default): D = diag(|J e_i|), as in the rank
// report; right for unknowns that have nothing in common. Take {3, 3} for the
// translation and the rotation of a pose. Columns scaled one by one are wrong
// there, for two reasons: a column that holds nothing but noise is scaled to
// length one as well, and looks determined; and a corridor along (cos a, sin a)
// has a short column, so that the step that corrects the distance e to a wall
// moves the pose by e cot(2a) along the corridor. With one scale for the
// translation, it is orthogonal to the corridor.
//
// Invariant, up to rounding:
//   r -> c r                              the same step
//   the unit of a group, x_g -> c x_g     the same motion
//   a rotation of a group's coordinates   the same motion
// Not invariant: another unit within a group, and another centre of rotation,
// which mixes translation and rotation. Take a centre within the data.
//
// The threshold. If the rows of J are measured, as the normals of
// point-to-plane residuals are, a direction without information has the s of
// the noise. Normals that are off by an angle of standard deviation sigma in
// each tangent direction give s = sqrt(3) sigma in a translation along all
// planes (H of that direction is sigma^2 a residual, D^2 is 1/3 a residual),
// and s_max >= 1. A direction is above the noise if its s is twice that, so
// that three quarters of the curvature are information:
//
//   tau = 2 sqrt(3) sigma         TauForNormals(sigma)
//
// The default, 0.1, is that of normals good to 0.029 rad (1.7 degrees). At that
// limit the step has at least ten times the standard deviation of the best
// direction. If J is exact, tau may be as small as 1e-6.
//
// The noise itself. Rotations have the lever arms of the scene: in a corridor of
// length L and width w, roll has s of about w / L, however exact it is. Where the
// rows' noise is known, SetNoise takes its Gram matrix W = E[(J - J_0)^T (J -
// J_0)], and neither D nor tau is used:
//
//   left alone  v^T H v <= 4 v^T W v
//
// which is the same limit, twice the noise, for each direction by its own noise.
// The step is then the shortest in the metric W, and nothing but the units of
// the unknowns changes with them. AddNoiseOfNormal adds what a normal has:
//
//   row (n, p x n):  W += sigma^2 M M^T,   M = (I; [p]_x)
//
// Hysteresis. A direction that was left alone in the last call is determined
// again at s > tau_high s_max only. The memory is the subspace of the motions
// D^-1 v: within the span of the v with tau s_max < s <= tau_high s_max, the
// principal directions that make less than 45 degrees (in the metric D^2) with
// it stay left alone. tau_high = sqrt(2) tau, a factor of 2 in curvature, is
// the default: three standard deviations of the curvature of 18 random rows.
// Use one object for unknowns in the same coordinates; Reset forgets.
//
// Shapes:  H: n x n, its lower triangle is read;  gradient = J^T r, step: n.
// Cost:    an eigenvalue decomposition and a factorization of n x n matrices;
//          DeterminedStep allocates nothing on the heap.
//          DeterminedStepOfAnySize costs 25 n^3 and n^2 doubles five times.
// Fails:   returns false, with *error, step = 0 and the memory as it was, if H
//          or gradient is not finite, or the noise is not positive
//          semidefinite. H = 0: everything is left alone.
//
// [1] Zhang, Kaess, Singh. On Degeneracy of Optimization-based State Estimation
//     Problems. ICRA 2016: the same projection with eigenvalues of H itself and
//     a threshold that has H's units.
#ifndef INVGRAD_DETERMINED_STEP_H_
#define INVGRAD_DETERMINED_STEP_H_

#include <string>
#include <vector>

#include "Eigen/Core"

namespace invgrad {

struct DeterminedStepOptions {
  double tau = 0.1;  // in [1e-6, 1)
  // At least tau; 0: sqrt(2) tau.
  double tau_high = 0.0;
  // The sizes of the groups, which add up to n. Empty: one unknown each.
  std::vector<int> group_sizes;

  double TauHigh() const;
  bool IsValid(std::string* error) const;

  // The threshold for normals whose angles have the standard deviation `sigma`
  // [rad] in each of the two tangent directions.
  static double TauForNormals(double sigma);
};

// kMaxSize: 6, or Eigen::Dynamic for any n.
template <int kMaxSize>
class BasicDeterminedStep {
 public:
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxSize, 1>;
  using Matrix = Eigen::
      Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxSize, kMaxSize>;

  // CHECKs that the options are valid.
  explicit BasicDeterminedStep(const DeterminedStepOptions& options = {});

  // W of the next calls, n x n, its lower triangle is read; of size 0: none.
  void SetNoise(const Eigen::Ref<const Eigen::MatrixXd>& noise) {
    noise_ = noise;
  }
  // Of a normal at p with errors of standard deviation sigma [rad], in a row
  // (n, p x n) of translation and rotation. W: 6 x 6.
  static void AddNoiseOfNormal(const Eigen::Vector3d& p,
                               double sigma,
                               Eigen::Matrix<double, 6, 6>* W);

  // CHECKs the sizes.
  bool Compute(const Eigen::Ref<const Eigen::MatrixXd>& H,
               const Eigen::Ref<const Eigen::VectorXd>& gradient,
               Vector* step,
               std::string* error);

  // Of the last successful call.
  // s / s_max, ascending: n; zero if H is.
  const Vector& singular_values() const { return singular_values_; }
  int num_left_alone() const { return static_cast<int>(left_alone_.cols()); }
  // Motions in the parameters' units, one a column; the largest entry is 1.
  const Matrix& left_alone() const { return left_alone_; }
  // |A v| / s_max of each of them.
  const Vector& left_alone_values() const { return left_alone_values_; }
  // "all 6 determined", or "2 of 6 left alone: s/s_max 0.012: +1 [0] -0.3 [4];
  // s/s_max 0: ...": at most three directions, of four entries each.
  std::string Report() const;

  // The memory of the hysteresis, n x num_left_alone().
  void Reset() { left_alone_.resize(0, 0); }
  void SetMemory(const Eigen::Ref<const Eigen::MatrixXd>& left_alone) {
    left_alone_ = left_alone;
  }

 private:
  void FindScales(const Eigen::Ref<const Eigen::MatrixXd>& H);
  // The transform by D, or by the noise.
  bool FindTransform(const Eigen::Ref<const Eigen::MatrixXd>& H,
                     std::string* error);
  // The columns of `basis` that span the left-alone directions come first.
  int LeaveAlone(int num_low, int num_band, Matrix* basis) const;

  DeterminedStepOptions options_;
  Matrix noise_;              // W; empty: none
  Vector scales_;             // the diagonal of D
  Matrix transform_;          // D^-1 or L^-T, W = L L^T: motion = transform v
  Matrix inverse_transform_;  // D or L^T
  Vector singular_values_;
  Matrix left_alone_;
  Vector left_alone_values_;
};

using DeterminedStep = BasicDeterminedStep<6>;
using DeterminedStepOfAnySize = BasicDeterminedStep<Eigen::Dynamic>;

}  // namespace invgrad

#endif  // INVGRAD_DETERMINED_STEP_H_
