#include "problems/schroedinger.h"

#include <algorithm>
#include <cmath>

#include "glog/logging.h"
#include "invgrad/chain/scratch.h"

namespace invgrad {

template <int kWidth>
struct SchroedingerSimulator::GridFunctions {
  using Array = Eigen::Array<double, kWidth, kNumPoints>;
  using Column = Eigen::Array<double, kWidth, 1>;
  Array re;
  Array im;

  // f <- 2 midpoint - f.
  void Advance(const GridFunctions& midpoint) {
    re = 2.0 * midpoint.re - re;
    im = 2.0 * midpoint.im - im;
  }
  // Sums f_k g_k over the points, without conjugation.
  void Dot(const GridFunction& g, Column* sum_re, Column* sum_im) const {
    Column a = Column::Zero(), b = Column::Zero();
    for (int k = 0; k < kNumPoints; ++k) {
      a += g.re[k] * re.col(k) - g.im[k] * im.col(k);
      b += g.re[k] * im.col(k) + g.im[k] * re.col(k);
    }
    *sum_re = a;
    *sum_im = b;
  }
};

SchroedingerSimulator::SchroedingerSimulator(int num_steps, double dt)
    : num_steps_(num_steps), dt_(dt), scale_(2.0 * kSpacing * kSpacing / dt) {
  CHECK_GT(num_steps, 0);
  CHECK(std::isfinite(scale_) && scale_ != 0.0) << "dt = " << dt;
}

Eigen::VectorXd SchroedingerSimulator::Eigenstate(int n) {
  CHECK(n >= 1 && n <= kNumPoints) << n;
  Eigen::VectorXd state = Eigen::VectorXd::Zero(kStateSize);
  for (int k = 0; k < kNumPoints; ++k) {
    state[2 * k] = std::sin(n * M_PI * (k + 1) / (kNumPoints + 1));
  }
  return state.normalized();
}

// Divided by its off-diagonal -i / scale, A becomes tridiag(1, a_k, 1) with
//   a_k = i scale - 2 - dx^2 u x_k,
// whose pivots d_k = a_k - 1 / d_{k-1} have |Im d_k| >= |scale|. Successive
// pivots wait for each other, steps do not: several go side by side.
void SchroedingerSimulator::Factor(const double* x, Step* steps) const {
  constexpr int kLanes = 8;
  using Lanes = Eigen::Array<double, kLanes, 1>;
  for (int first = 0; first < num_steps_; first += kLanes) {
    const int num_lanes = std::min(kLanes, num_steps_ - first);
    Lanes u = Lanes::Zero();
    std::copy_n(x + first, num_lanes, u.data());
    Lanes re = Lanes::Zero(), im = Lanes::Zero();  // 1 / d_{k-1}
    for (int k = 0; k < kNumPoints; ++k) {
      const double x_k = (k + 1) * kSpacing;
      const Lanes d_re = -2.0 - (kSpacing * kSpacing * x_k) * u - re;
      const Lanes d_im = scale_ - im;
      const Lanes inverse_square = 1.0 / (d_re * d_re + d_im * d_im);
      re = d_re * inverse_square;
      im = -d_im * inverse_square;
      for (int lane = 0; lane < num_lanes; ++lane) {
        steps[first + lane].inverse_pivots.re[k] = re[lane];
        steps[first + lane].inverse_pivots.im[k] = im[lane];
      }
    }
  }
}

// A = L U, with the unit lower L and upper U of Gaussian elimination, both of
// which hold nothing but the inverse pivots once the off-diagonals are one.
template <int kWidth>
void SchroedingerSimulator::Solve(const GridFunction& inverse_pivots,
                                  const GridFunctions<kWidth>& c,
                                  GridFunctions<kWidth>* solution) const {
  using Column = typename GridFunctions<kWidth>::Column;
  auto& re = solution->re;
  auto& im = solution->im;
  Column last_re = Column::Zero(), last_im = Column::Zero();
  for (int k = 0; k < kNumPoints; ++k) {
    const double e_re = inverse_pivots.re[k];
    const double e_im = inverse_pivots.im[k];
    // The right-hand side is divided by -i / scale as well.
    const Column b_re = -scale_ * c.im.col(k) - last_re;
    const Column b_im = scale_ * c.re.col(k) - last_im;
    last_re = e_re * b_re - e_im * b_im;
    last_im = e_re * b_im + e_im * b_re;
    re.col(k) = last_re;
    im.col(k) = last_im;
  }
  for (int k = kNumPoints - 2; k >= 0; --k) {
    const double e_re = inverse_pivots.re[k];
    const double e_im = inverse_pivots.im[k];
    const Column next_re = re.col(k) - (e_re * last_re - e_im * last_im);
    const Column next_im = im.col(k) - (e_re * last_im + e_im * last_re);
    last_re = next_re;
    last_im = next_im;
    re.col(k) = last_re;
    im.col(k) = last_im;
  }
}

SchroedingerSimulator::GridFunction SchroedingerSimulator::Source(
    const GridFunctions<1>& f) const {
  GridFunction source;
  for (int k = 0; k < kNumPoints; ++k) {
    const double dt_x = dt_ * (k + 1) * kSpacing;
    source.re[k] = dt_x * f.im[k];
    source.im[k] = -dt_x * f.re[k];
  }
  return source;
}

bool SchroedingerSimulator::RollOut(const double* x,
                                    const double* context,
                                    Step* steps,
                                    double* y) const {
  Factor(x, steps);
  GridFunctions<1> psi, midpoint;
  for (int k = 0; k < kNumPoints; ++k) {
    psi.re[k] = context[2 * k];
    psi.im[k] = context[2 * k + 1];
  }
  for (int t = 0; t < num_steps_; ++t) {
    Solve(steps[t].inverse_pivots, psi, &midpoint);
    steps[t].source = Source(midpoint);
    psi.Advance(midpoint);
  }
  for (int k = 0; k < kNumPoints; ++k) {
    y[2 * k] = psi.re[k];
    y[2 * k + 1] = psi.im[k];
  }
  return AllFinite(y, kStateSize);
}

bool SchroedingerSimulator::Evaluate(const double* x,
                                     const double* context,
                                     double* y,
                                     double* jacobian) const {
  Scratch<Step> steps(num_steps_);
  if (!RollOut(x, context, steps.data(), y)) return false;
  if (jacobian == nullptr) return true;
  // Row j of c is that of point j: rows 2 j and 2 j + 1 of J are the real and
  // the imaginary part of one complex row.
  GridFunctions<kNumPoints> c, q;
  c.re = Eigen::Matrix<double, kNumPoints, kNumPoints>::Identity().array();
  c.im.setZero();
  Eigen::Array<double, kNumPoints, 1> re, im;
  for (int t = num_steps_ - 1; t >= 0; --t) {
    Solve(steps[t].inverse_pivots, c, &q);
    q.Dot(steps[t].source, &re, &im);
    for (int j = 0; j < kNumPoints; ++j) {
      jacobian[2 * j * num_steps_ + t] = re[j];
      jacobian[(2 * j + 1) * num_steps_ + t] = im[j];
    }
    c.Advance(q);
  }
  return AllFinite(jacobian, kStateSize * num_steps_);
}

bool SchroedingerSimulator::PullBack(const double* x,
                                     const double* context,
                                     const Covector& covector,
                                     double* y,
                                     double* x_bar) const {
  Scratch<Step> steps(num_steps_);
  if (!RollOut(x, context, steps.data(), y)) return false;
  double w[kStateSize];
  if (!covector(y, w)) return false;
  // w . y is the real part of c^T psi with c the conjugate of w.
  GridFunctions<1> c, q;
  for (int k = 0; k < kNumPoints; ++k) {
    c.re[k] = w[2 * k];
    c.im[k] = -w[2 * k + 1];
  }
  Eigen::Array<double, 1, 1> re, im;
  for (int t = num_steps_ - 1; t >= 0; --t) {
    Solve(steps[t].inverse_pivots, c, &q);
    q.Dot(steps[t].source, &re, &im);
    x_bar[t] = re[0];
    c.Advance(q);
  }
  return AllFinite(x_bar, num_steps_);
}

bool SchroedingerSimulator::WeightedHessian(const double* x,
                                            const double* context,
                                            const double* w,
                                            double* hessian) const {
  Scratch<Step> steps(num_steps_);
  double y[kStateSize];
  if (!RollOut(x, context, steps.data(), y)) return false;
  // -i dt X q of every step.
  Scratch<GridFunction> adjoint_sources(num_steps_);
  GridFunctions<1> c, q;
  for (int k = 0; k < kNumPoints; ++k) {
    c.re[k] = w[2 * k];
    c.im[k] = -w[2 * k + 1];
  }
  for (int t = num_steps_ - 1; t >= 0; --t) {
    Solve(steps[t].inverse_pivots, c, &q);
    adjoint_sources[t] = Source(q);
    c.Advance(q);
  }
  // The tangents dpsi/du_s of kNumPoints successive s, forward from the first.
  Eigen::Map<Eigen::MatrixXd> H(hessian, num_steps_, num_steps_);
  for (int first = 0; first < num_steps_; first += kNumPoints) {
    GridFunctions<kNumPoints> tangents, midpoints;
    tangents.re.setZero();
    tangents.im.setZero();
    for (int t = first; t < num_steps_; ++t) {
      const int born = t - first;
      if (born > 0) {
        Solve(steps[t].inverse_pivots, tangents, &midpoints);
        tangents.Advance(midpoints);
        Eigen::Array<double, kNumPoints, 1> re, im;
        midpoints.Dot(adjoint_sources[t], &re, &im);
        for (int i = 0; i < std::min(born, kNumPoints); ++i) {
          H(first + i, t) = H(t, first + i) = re[i];
        }
      }
      if (born < kNumPoints) {
        GridFunctions<1> source, tangent;
        std::copy_n(steps[t].source.re, kNumPoints, source.re.data());
        std::copy_n(steps[t].source.im, kNumPoints, source.im.data());
        Solve(steps[t].inverse_pivots, source, &tangent);
        tangents.re.row(born) = tangent.re;
        tangents.im.row(born) = tangent.im;
        Eigen::Array<double, 1, 1> re, im;
        tangent.Dot(adjoint_sources[t], &re, &im);
        H(t, t) = re[0];
      }
    }
  }
  return AllFinite(hessian, H.size());
}

}  // namespace invgrad
