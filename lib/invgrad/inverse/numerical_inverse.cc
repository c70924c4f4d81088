#include "invgrad/inverse/numerical_inverse.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "fmt/core.h"
#include "invgrad/core/small_svd.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/scratch.h"
#include "invgrad/inverse_simulator.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Initial damping, relative to s_max^2, and the smallest factor by which an
// iteration reduces the damping.
constexpr double kFirstDamping = 1e-4;
constexpr double kStrongestReduction = 1e-2;

// The rounding error of P(x), relative to y.
constexpr double kRounding = 8.0 * std::numeric_limits<double>::epsilon();

// |r|^2 is flat if its relative decrease is smaller.
constexpr double kFlat = 1e-14;

// r = (P(x) - y) / scale.
struct ScaledResidual {
  const Simulator& simulator;
  const double* context;
  const InverseSimulator::ConstVectorRef& y;
  double scale = 1.0;

  bool operator()(const VectorXd& x, VectorXd* r) const {
    if (!simulator.Evaluate(x.data(), context, r->data(), nullptr)) {
      return false;
    }
    *r = (*r - y) / scale;
    return true;
  }
};

// Minimizes |r(x)| from *x, where r is *r, down to |r| <= target. Returns the
// number of iterations.
int Minimize(const ScaledResidual& residual,
             double target,
             int max_num_iterations,
             VectorXd* x,
             VectorXd* r) {
  Scratch<double> ignored(r->size());
  MatrixXd J_transposed(x->size(), r->size());
  SmallSvd svd;
  VectorXd c;  // U^T r
  VectorXd r_new(r->size());
  double damping = 0.0;
  double growth = 2.0;
  bool has_moved = true;
  for (int i = 0; i < max_num_iterations; ++i) {
    if (has_moved) {
      if (!residual.simulator.Evaluate(x->data(),
                                       residual.context,
                                       ignored.data(),
                                       J_transposed.data())) {
        return i;
      }
      J_transposed /= residual.scale;
      svd.Compute(J_transposed.transpose());
      c = svd.U.transpose() * *r;
    }
    const auto s = svd.s.array();
    if (!(s[0] > 0.0)) return i;
    if (i == 0) damping = kFirstDamping * s[0] * s[0];
    // The residual of c in the linear model.
    const VectorXd left = damping / (s.square() + damping);
    const VectorXd x_new =
        *x - svd.V * (c.array() * s / (s.square() + damping)).matrix();
    if (x_new == *x) return i;
    const bool has_value = residual(x_new, &r_new);
    const double expected =
        c.squaredNorm() - c.cwiseProduct(left).squaredNorm();
    const double fall = r->squaredNorm() - r_new.squaredNorm();
    has_moved = has_value && fall > 0.0;
    if (!has_moved) {
      damping *= growth;
      growth *= 2.0;
      continue;
    }
    const bool is_flat = fall <= kFlat * r->squaredNorm();
    *x = x_new;
    r->swap(r_new);
    if (is_flat || r->norm() <= target) return i + 1;
    const double gain = 2.0 * fall / expected - 1.0;
    damping *= std::max(kStrongestReduction, 1.0 - gain * gain * gain);
    growth = 2.0;
  }
  return max_num_iterations;
}

}  // namespace

NumericalInverse::NumericalInverse(std::shared_ptr<const Simulator> simulator,
                                   const Options& options)
    : simulator_(std::move(simulator)), options_(options) {
  CHECK(simulator_ != nullptr);
  CHECK_GE(options.max_num_iterations, 1);
  CHECK_GT(options.tolerance, 0.0);
}

bool NumericalInverse::Invert(const ConstVectorRef& y,
                              const ConstVectorRef& x_now,
                              const ConstVectorRef& context,
                              VectorXd* x,
                              std::string* why) const {
  CHECK_EQ(y.size(), simulator_->num_outputs());
  CHECK_EQ(x_now.size(), simulator_->num_inputs());
  CHECK_EQ(context.size(), simulator_->num_context());
  ScaledResidual residual{*simulator_, context.data(), y};
  *x = x_now;
  VectorXd r(y.size());
  if (!residual(*x, &r)) {
    *why = "the simulator has no finite value at x_now";
    return false;
  }
  const double distance = r.stableNorm();
  if (distance == 0.0) return true;
  if (!std::isfinite(distance)) {
    *why = "the wanted output is not finite";
    return false;
  }
  residual.scale = distance;
  r /= distance;
  // Quadratic convergence: a thousandth of the tolerance costs one more
  // iteration.
  const double target = std::min(options_.tolerance, 1e-3) * 1e-3;
  const int num_iterations =
      Minimize(residual, target, options_.max_num_iterations, x, &r);
  const double left = r.norm();
  // y itself has a rounding error.
  const double rounding = kRounding * y.stableNorm() / distance;
  if (left <= options_.tolerance + rounding) return true;
  *why = fmt::format(
      "the numerical inverse came {:.6f} % of the way in {} iterations",
      100.0 * (1.0 - left),
      num_iterations);
  return false;
}

}  // namespace invgrad
