#include "problems/schroedinger.h"

#include <algorithm>
#include <cmath>

#include "glog/logging.h"
#include "invgrad/internal/lanes.h"
#include "invgrad/internal/scratch.h"

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
  using Lanes = Values<kLanes>;
  for (int first = 0; first < num_steps_; first += kLanes) {
    const int num_lanes = std::min(kLanes, num_steps_ - first);
    Lanes u = Lanes::Zero();
    u.head(num_lanes) = Eigen::Map<const Eigen::ArrayXd>(x + first, num_lanes);
    Lanes re = Lanes::Zero(), im = Lanes::Zero();  // 1 / d_{k-1}
    for (int k = 0; k < kNumPoints; ++k) {
      const double slope = kSpacing * kSpacing * (k + 1) * kSpacing;
      const Lanes d_re = -2.0 - slope * u - re;
      const Lanes d_im = scale_ - im;
      const Lanes inverse_square = (d_re * d_re + d_im * d_im).inverse();
      re = d_re * inverse_square;
      im = -d_im * inverse_square;
      for (int lane = 0; lane < num_lanes; ++lane) {
        steps[first + lane].inverse_pivots.re[k] = re[lane];
        steps[first + lane].inverse_pivots.im[k] = im[lane];
      }
    }
  }
}

void SchroedingerSimulator::FactorLanes(const double* x,
                                        LaneStep* steps) const {
  using Lanes = Values<kLanes>;
  for (int t = 0; t < num_steps_; ++t) {
    Lanes u;
    for (int lane = 0; lane < kLanes; ++lane)
      u[lane] = x[lane * num_steps_ + t];
    Lanes re = Lanes::Zero(), im = Lanes::Zero();  // 1 / d_{k-1}
    for (int k = 0; k < kNumPoints; ++k) {
      const double slope = kSpacing * kSpacing * (k + 1) * kSpacing;
      const Lanes d_re = -2.0 - slope * u - re;
      const Lanes d_im = scale_ - im;
      const Lanes inverse_square = (d_re * d_re + d_im * d_im).inverse();
      re = d_re * inverse_square;
      im = -d_im * inverse_square;
      steps[t].inverse_pivots.re.col(k) = re;
      steps[t].inverse_pivots.im.col(k) = im;
    }
  }
}

// The values at point k: a number if there is one function.
template <typename Array>
static auto At(const Array& f, int k) {
  if constexpr (Array::RowsAtCompileTime == 1) {
    return f[k];
  } else {
    return Eigen::Array<double, Array::RowsAtCompileTime, 1>(f.col(k));
  }
}

// Gaussian elimination. With off-diagonals of one, its factors are the inverse
// pivots e_k:
//   down  p_k = e_k (b_k - p_{k-1}),   up  p_k -= e_k p_{k+1}.
template <int kNumPivots, int kWidth>
void SchroedingerSimulator::Solve(
    const GridFunctions<kNumPivots>& inverse_pivots,
    const GridFunctions<kWidth>& c,
    GridFunctions<kWidth>* solution) const {
  // p_{k-1}, then p_{k+1}
  Values<kWidth> re = Values<kWidth>::Zero(), im = Values<kWidth>::Zero();
  for (int k = 0; k < kNumPoints; ++k) {
    const auto e_re = At(inverse_pivots.re, k);
    const auto e_im = At(inverse_pivots.im, k);
    // The right-hand side is also divided by -i / scale.
    const Values<kWidth> b_re = -scale_ * c.im.col(k) - re;
    const Values<kWidth> b_im = scale_ * c.re.col(k) - im;
    solution->re.col(k) = re = e_re * b_re - e_im * b_im;
    solution->im.col(k) = im = e_re * b_im + e_im * b_re;
  }
  for (int k = kNumPoints - 2; k >= 0; --k) {
    const auto e_re = At(inverse_pivots.re, k);
    const auto e_im = At(inverse_pivots.im, k);
    const Values<kWidth> above_re = re;
    re = solution->re.col(k) - (e_re * above_re - e_im * im);
    im = solution->im.col(k) - (e_re * im + e_im * above_re);
    solution->re.col(k) = re;
    solution->im.col(k) = im;
  }
}

// f <- 2 midpoint - f.
template <typename GridFunctions>
static void Advance(const GridFunctions& midpoint, GridFunctions* f) {
  f->re = 2.0 * midpoint.re - f->re;
  f->im = 2.0 * midpoint.im - f->im;
}

template <int kWidth, int kNumFactors>
void SchroedingerSimulator::Dot(const GridFunctions<kWidth>& f,
                                const GridFunctions<kNumFactors>& g,
                                Values<kWidth>* re,
                                Values<kWidth>* im) {
  re->setZero();
  im->setZero();
  for (int k = 0; k < kNumPoints; ++k) {
    const auto g_re = At(g.re, k);
    const auto g_im = At(g.im, k);
    *re += g_re * f.re.col(k) - g_im * f.im.col(k);
    *im += g_re * f.im.col(k) + g_im * f.re.col(k);
  }
}

SchroedingerSimulator::GridFunction SchroedingerSimulator::Source(
    const GridFunction& f) const {
  const auto dt_x = dt_ * decltype(f.re)::LinSpaced(1.0, kNumPoints) * kSpacing;
  return {dt_x * f.im, -dt_x * f.re};
}

// The real and imaginary parts of a state alternate.
SchroedingerSimulator::GridFunction SchroedingerSimulator::FromState(
    const double* state) {
  const Eigen::Map<const Eigen::Array<double, 2, kNumPoints>> parts(state);
  return {parts.row(0), parts.row(1)};
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
  Eigen::Map<Eigen::Array<double, 2, kNumPoints>>(y) << psi.re, psi.im;
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
  GridFunctions<kNumPoints> c, q;
  c.re.matrix().setIdentity();
  c.im.setZero();
  Values<kNumPoints> re, im;
  for (int t = num_steps_ - 1; t >= 0; --t) {
    Solve(steps[t].inverse_pivots, c, &q);
    Dot(q, steps[t].source, &re, &im);
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
  c.im = -c.im;
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
    Values<1> re, im;
    Dot(q, steps[t].source, &re, &im);
    x_bar[t] = re[0];
  });
  return AllFinite(x_bar, num_steps_);
}

bool SchroedingerSimulator::RollOutLanes(const double* x,
                                         const double* contexts,
                                         LaneStep* steps,
                                         double* y) const {
  FactorLanes(x, steps);
  GridFunctions<kLanes> psi, midpoint;
  for (int lane = 0; lane < kLanes; ++lane) {
    const GridFunction start = FromState(contexts + lane * kStateSize);
    psi.re.row(lane) = start.re;
    psi.im.row(lane) = start.im;
  }
  // -i dt X applied to ones.
  GridFunction ones;
  ones.re.setZero();
  ones.im.setOnes();
  const auto dt_x = Source(ones).re;
  for (int t = 0; t < num_steps_; ++t) {
    Solve(steps[t].inverse_pivots, psi, &midpoint);
    for (int k = 0; k < kNumPoints; ++k) {
      steps[t].source.re.col(k) = dt_x[k] * midpoint.im.col(k);
      steps[t].source.im.col(k) = -dt_x[k] * midpoint.re.col(k);
    }
    Advance(midpoint, &psi);
  }
  for (int lane = 0; lane < kLanes; ++lane) {
    Eigen::Map<Eigen::Array<double, 2, kNumPoints>>(y + lane * kStateSize)
        << psi.re.row(lane),
        psi.im.row(lane);
  }
  return AllFinite(y, kLanes * kStateSize);
}

bool SchroedingerSimulator::AdjointLanes(int first,
                                         const double* x,
                                         const double* contexts,
                                         const BatchCovector& covector,
                                         double* x_bar) const {
  Scratch<LaneStep> steps(num_steps_);
  double y[kLanes * kStateSize];
  if (!RollOutLanes(x, contexts, steps.data(), y)) return false;
  GridFunctions<kLanes> c, q;
  for (int lane = 0; lane < kLanes; ++lane) {
    double w[kStateSize];
    if (!covector(first + lane, y + lane * kStateSize, w)) return false;
    const GridFunction start = FromState(w);
    c.re.row(lane) = start.re;
    c.im.row(lane) = -start.im;
  }
  Values<kLanes> re, im;
  for (int t = num_steps_ - 1; t >= 0; --t) {
    Solve(steps[t].inverse_pivots, c, &q);
    Dot(q, steps[t].source, &re, &im);
    for (int lane = 0; lane < kLanes; ++lane) {
      x_bar[lane * num_steps_ + t] = re[lane];
    }
    Advance(q, &c);
  }
  return AllFinite(x_bar, kLanes * num_steps_);
}

int SchroedingerSimulator::EvaluateBatch(int count,
                                         const double* x,
                                         const double* contexts,
                                         double* y,
                                         double* jacobians) const {
  if (jacobians != nullptr) {
    return Simulator::EvaluateBatch(count, x, contexts, y, jacobians);
  }
  Scratch<LaneStep> steps(num_steps_);
  return ForSamplesInLanes(
      count,
      true,
      [&](int s) {
        return RollOutLanes(x + s * num_steps_,
                            contexts + s * kStateSize,
                            steps.data(),
                            y + s * kStateSize);
      },
      [&](int s) {
        return Evaluate(x + s * num_steps_,
                        contexts + s * kStateSize,
                        y + s * kStateSize,
                        nullptr);
      });
}

int SchroedingerSimulator::AdjointBatch(int count,
                                        const double* x,
                                        const double* contexts,
                                        const BatchCovector& covector,
                                        double* x_bar) const {
  double y[kStateSize];
  return ForSamplesInLanes(
      count,
      true,
      [&](int s) {
        return AdjointLanes(s,
                            x + s * num_steps_,
                            contexts + s * kStateSize,
                            covector,
                            x_bar + s * num_steps_);
      },
      [&](int s) {
        return Adjoint(
            x + s * num_steps_,
            contexts + s * kStateSize,
            [&](const double* at, double* w) { return covector(s, at, w); },
            y,
            x_bar + s * num_steps_);
      });
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
  Values<kNumPoints> re, im;
  for (int first = 0; first < num_steps_; first += kNumPoints) {
    GridFunctions<kNumPoints> tangents, midpoints;
    tangents.re.setZero();
    tangents.im.setZero();
    for (int t = first; t < num_steps_; ++t) {
      const int num_tangents = std::min(t - first, kNumPoints);
      Solve(steps[t].inverse_pivots, tangents, &midpoints);
      Dot(midpoints, adjoint_sources[t], &re, &im);
      Advance(midpoints, &tangents);
      for (int j = 0; j < num_tangents; ++j) {
        H(first + j, t) = H(t, first + j) = re[j];
      }
      if (num_tangents < kNumPoints) {
        GridFunction tangent;
        Solve(steps[t].inverse_pivots, steps[t].source, &tangent);
        Values<1> curvature, unused;
        Dot(tangent, adjoint_sources[t], &curvature, &unused);
        H(t, t) = curvature[0];
        tangents.re.row(num_tangents) = tangent.re;
        tangents.im.row(num_tangents) = tangent.im;
      }
    }
  }
  return AllFinite(hessian, H.size());
}

}  // namespace invgrad
