#include "problems/schroedinger.h"

#include <algorithm>
#include <cmath>

#include "glog/logging.h"
#include "invgrad/core/scratch.h"

// The loops over kWidth functions and over lanes have constant lengths and
// write to local arrays, which cannot overlap, so that the compiler vectorizes
// them. If GCC 12 unrolls the upward loops of Solve first, the Jacobian takes a
// tenth longer.

namespace invgrad {

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
// whose pivots d_k = a_k - 1 / d_{k-1} have |Im d_k| >= |scale|. Pivots of one
// step depend on each other, steps are independent: several steps are computed
// side by side.
void SchroedingerSimulator::Factor(const double* x, Step* steps) const {
  constexpr int kLanes = 8;
  for (int first = 0; first < num_steps_; first += kLanes) {
    const int num_lanes = std::min(kLanes, num_steps_ - first);
    double u[kLanes] = {};
    double re[kLanes] = {}, im[kLanes] = {};  // 1 / d_{k-1}
    std::copy_n(x + first, num_lanes, u);
    for (int k = 0; k < kNumPoints; ++k) {
      const double slope = kSpacing * kSpacing * (k + 1) * kSpacing;
      for (int lane = 0; lane < kLanes; ++lane) {
        const double d_re = -2.0 - slope * u[lane] - re[lane];
        const double d_im = scale_ - im[lane];
        const double inverse_square = 1.0 / (d_re * d_re + d_im * d_im);
        re[lane] = d_re * inverse_square;
        im[lane] = -d_im * inverse_square;
      }
      for (int lane = 0; lane < num_lanes; ++lane) {
        steps[first + lane].inverse_pivots.re[k] = re[lane];
        steps[first + lane].inverse_pivots.im[k] = im[lane];
      }
    }
  }
}

// Gaussian elimination. With off-diagonals of one, its factors are the inverse
// pivots e_k:
//   down  p_k = e_k (b_k - p_{k-1}),   up  p_k -= e_k p_{k+1}.
template <int kWidth>
void SchroedingerSimulator::Solve(const GridFunction& inverse_pivots,
                                  const GridFunctions<kWidth>& c,
                                  GridFunctions<kWidth>* solution) const {
  double re[kWidth] = {}, im[kWidth] = {};  // p_{k-1}, then p_{k+1}
  for (int k = 0; k < kNumPoints; ++k) {
    const double e_re = inverse_pivots.re[k];
    const double e_im = inverse_pivots.im[k];
    const double* c_re = c.re + kWidth * k;
    const double* c_im = c.im + kWidth * k;
    for (int j = 0; j < kWidth; ++j) {
      // The right-hand side is also divided by -i / scale.
      const double b_re = -scale_ * c_im[j] - re[j];
      const double b_im = scale_ * c_re[j] - im[j];
      re[j] = e_re * b_re - e_im * b_im;
      im[j] = e_re * b_im + e_im * b_re;
    }
    for (int j = 0; j < kWidth; ++j) {
      solution->re[kWidth * k + j] = re[j];
      solution->im[kWidth * k + j] = im[j];
    }
  }
  for (int k = kNumPoints - 2; k >= 0; --k) {
    const double e_re = inverse_pivots.re[k];
    const double e_im = inverse_pivots.im[k];
    double* p_re = solution->re + kWidth * k;
    double* p_im = solution->im + kWidth * k;
#pragma GCC unroll 1
    for (int j = 0; j < kWidth; ++j) {
      const double above_re = re[j];
      re[j] = p_re[j] - (e_re * above_re - e_im * im[j]);
      im[j] = p_im[j] - (e_re * im[j] + e_im * above_re);
    }
#pragma GCC unroll 1
    for (int j = 0; j < kWidth; ++j) {
      p_re[j] = re[j];
      p_im[j] = im[j];
    }
  }
}

template <int kWidth>
void SchroedingerSimulator::Advance(const GridFunctions<kWidth>& midpoint,
                                    GridFunctions<kWidth>* f) {
  for (int i = 0; i < kWidth * kNumPoints; ++i) {
    f->re[i] = 2.0 * midpoint.re[i] - f->re[i];
    f->im[i] = 2.0 * midpoint.im[i] - f->im[i];
  }
}

template <int kWidth>
void SchroedingerSimulator::Dot(const GridFunctions<kWidth>& f,
                                const GridFunction& g,
                                double* re,
                                double* im) {
  double sum_re[kWidth] = {}, sum_im[kWidth] = {};
  for (int k = 0; k < kNumPoints; ++k) {
    const double* f_re = f.re + kWidth * k;
    const double* f_im = f.im + kWidth * k;
    for (int j = 0; j < kWidth; ++j) {
      sum_re[j] += g.re[k] * f_re[j] - g.im[k] * f_im[j];
      sum_im[j] += g.re[k] * f_im[j] + g.im[k] * f_re[j];
    }
  }
  std::copy_n(sum_re, kWidth, re);
  std::copy_n(sum_im, kWidth, im);
}

SchroedingerSimulator::GridFunction SchroedingerSimulator::Source(
    const GridFunction& f) const {
  GridFunction source;
  for (int k = 0; k < kNumPoints; ++k) {
    const double dt_x = dt_ * (k + 1) * kSpacing;
    source.re[k] = dt_x * f.im[k];
    source.im[k] = -dt_x * f.re[k];
  }
  return source;
}

SchroedingerSimulator::GridFunction SchroedingerSimulator::FromState(
    const double* state) {
  GridFunction f;
  for (int k = 0; k < kNumPoints; ++k) {
    f.re[k] = state[2 * k];
    f.im[k] = state[2 * k + 1];
  }
  return f;
}

bool SchroedingerSimulator::RollOut(const double* x,
                                    const double* context,
                                    Step* steps,
                                    double* y) const {
  Factor(x, steps);
  GridFunction psi = FromState(context), midpoint;
  for (int t = 0; t < num_steps_; ++t) {
    Solve(steps[t].inverse_pivots, psi, &midpoint);
    steps[t].source = Source(midpoint);
    Advance(midpoint, &psi);
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
  // Rows 2 j and 2 j + 1 of J are the real and the imaginary part of one
  // complex row, with c for point j.
  GridFunctions<kNumPoints> c = {}, q;
  for (int k = 0; k < kNumPoints; ++k) c.re[kNumPoints * k + k] = 1.0;
  double re[kNumPoints], im[kNumPoints];
  for (int t = num_steps_ - 1; t >= 0; --t) {
    Solve(steps[t].inverse_pivots, c, &q);
    Dot(q, steps[t].source, re, im);
    Advance(q, &c);
    for (int j = 0; j < kNumPoints; ++j) {
      jacobian[2 * j * num_steps_ + t] = re[j];
      jacobian[(2 * j + 1) * num_steps_ + t] = im[j];
    }
  }
  return AllFinite(jacobian, kStateSize * num_steps_);
}

std::string SchroedingerSimulator::DescribeFailure(
    const double* x, const double* context) const {
  Scratch<Step> steps(num_steps_);
  Factor(x, steps.data());
  GridFunction psi = FromState(context), midpoint;
  // The step of the first source that is not finite, if any.
  int failed_derivative = num_steps_;
  for (int t = 0; t < num_steps_; ++t) {
    Solve(steps[t].inverse_pivots, psi, &midpoint);
    Advance(midpoint, &psi);
    if (!IsFinite(psi)) {
      return AtTimeStep("the state is not finite after", t, num_steps_);
    }
    if (failed_derivative == num_steps_ && !IsFinite(Source(midpoint))) {
      failed_derivative = t;
    }
  }
  if (failed_derivative == num_steps_) return "";
  return AtTimeStep(
      "its derivative is not finite at", failed_derivative, num_steps_);
}

template <typename Visit>
void SchroedingerSimulator::ChainBack(const double* w,
                                      const Step* steps,
                                      const Visit& visit) const {
  GridFunction c = FromState(w), q;
  for (double& value : c.im) value = -value;
  for (int t = num_steps_ - 1; t >= 0; --t) {
    Solve(steps[t].inverse_pivots, c, &q);
    visit(t, q);
    Advance(q, &c);
  }
}

bool SchroedingerSimulator::Adjoint(const double* x,
                                    const double* context,
                                    const Covector& covector,
                                    double* y,
                                    double* x_bar) const {
  Scratch<Step> steps(num_steps_);
  if (!RollOut(x, context, steps.data(), y)) return false;
  double w[kStateSize];
  if (!covector(y, w)) return false;
  ChainBack(w, steps.data(), [&](int t, const GridFunction& q) {
    double im;
    Dot(q, steps[t].source, x_bar + t, &im);
  });
  return AllFinite(x_bar, num_steps_);
}

bool SchroedingerSimulator::WeightedHessian(const double* x,
                                            const double* context,
                                            const double* w,
                                            double* hessian) const {
  Scratch<Step> steps(num_steps_);
  double y[kStateSize];
  if (!RollOut(x, context, steps.data(), y)) return false;
  Scratch<GridFunction> adjoint_sources(num_steps_);  // -i dt X q_t
  ChainBack(w, steps.data(), [&](int t, const GridFunction& q) {
    adjoint_sources[t] = Source(q);
  });
  // Propagates the tangents dpsi_t/du_s of kNumPoints successive s side by
  // side; tangents with s >= t are zero.
  Eigen::Map<Eigen::MatrixXd> H(hessian, num_steps_, num_steps_);
  double re[kNumPoints], im[kNumPoints];
  for (int first = 0; first < num_steps_; first += kNumPoints) {
    GridFunctions<kNumPoints> tangents = {}, midpoints;
    for (int t = first; t < num_steps_; ++t) {
      const int num_tangents = std::min(t - first, kNumPoints);
      Solve(steps[t].inverse_pivots, tangents, &midpoints);
      Dot(midpoints, adjoint_sources[t], re, im);
      Advance(midpoints, &tangents);
      for (int j = 0; j < num_tangents; ++j) {
        H(first + j, t) = H(t, first + j) = re[j];
      }
      if (num_tangents < kNumPoints) {
        GridFunction tangent;
        Solve(steps[t].inverse_pivots, steps[t].source, &tangent);
        Dot(tangent, adjoint_sources[t], re, im);
        H(t, t) = re[0];
        for (int k = 0; k < kNumPoints; ++k) {
          tangents.re[kNumPoints * k + num_tangents] = tangent.re[k];
          tangents.im[kNumPoints * k + num_tangents] = tangent.im[k];
        }
      }
    }
  }
  return AllFinite(hessian, H.size());
}

}  // namespace invgrad
