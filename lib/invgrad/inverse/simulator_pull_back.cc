#include "invgrad/inverse/simulator_pull_back.h"

#include <algorithm>
#include <exception>
#include <limits>
#include <utility>

#include "fmt/core.h"
#include "invgrad/core/small_svd.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/scratch.h"
#include "invgrad/inverse/numerical_inverse.h"
#include "invgrad/inverse_simulator.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using ConstVectorRef = InverseSimulator::ConstVectorRef;

// If J is nearly singular, the minimizer of the linear model is far away.
constexpr int kMaxNumHalvings = 40;

// V S^(-kappa) U^T d_y, s > tau s_max, of the J of `simulator`, which J()
// returns if the simulator does not apply it itself.
template <typename Jacobian>
VectorXd SpectralPullBack(const Simulator& simulator,
                          const Jacobian& J,
                          const ConstVectorRef& d_y,
                          double kappa,
                          double tau) {
  if (simulator.is_linear()) {
    VectorXd d_x(simulator.num_inputs());
    simulator.InversePower(kappa, tau, d_y.data(), d_x.data());
    return d_x;
  }
  SmallSvd svd;
  svd.Compute(J());
  return svd.InversePowerTimes(kappa, tau, d_y);
}

// The rounding error of an exact inverse in |P(x~) - y~| / |y~|.
constexpr double kInverseRounding =
    8.0 * std::numeric_limits<double>::epsilon();

bool IsFinite(const VectorXd& v) { return AllFinite(v.data(), v.size()); }

}  // namespace

SimulatorPullBack::SimulatorPullBack(
    std::shared_ptr<const Simulator> simulator,
    std::shared_ptr<const InverseSimulator> inverse,
    const Options& options)
    : simulator_(std::move(simulator)),
      inverse_(std::move(inverse)),
      options_(options) {
  CHECK(simulator_ != nullptr);
  CHECK(options.way != SimulatorWay::kJoint &&
        options.way != SimulatorWay::kData)
      << "the ways joint and data pull nothing back through the simulator";
  CHECK_GE(options.truncation, 0.0);
  CHECK_GT(options.round_trip, 0.0);
  if (options.way == SimulatorWay::kNewton) {
    inverse_ = std::make_shared<NewtonInverse>(simulator_, options.newton);
  } else if (options.way != SimulatorWay::kInverse) {
    inverse_ = nullptr;
  }
  NumericalInverse::Options numerical;
  numerical.max_num_iterations = options.max_num_iterations;
  numerical.tolerance = options.round_trip;
  numerical_ = std::make_shared<NumericalInverse>(simulator_, numerical);
}

// One sample's pull-back through inverses.
class SimulatorPullBack::Attempt {
 public:
  Attempt(const SimulatorPullBack& pull_back,
          const ConstVectorRef& x,
          const ConstVectorRef& context,
          const ConstVectorRef& y,
          const ConstVectorRef& d_y)
      : options_(pull_back.options_),
        simulator_(*pull_back.simulator_),
        x_(x),
        context_(context),
        d_y_(d_y),
        wanted_(y + d_y),
        distance_(d_y.stableNorm()) {}

  // Computes x~ by the inverse; returns the reason if that fails, else "".
  std::string Invert(const InverseSimulator& inverse) {
    std::string why;
    bool is_inverted = false;
    try {
      is_inverted = inverse.Invert(wanted_, x_, context_, &x_new_, &why);
    } catch (const std::exception& exception) {
      return fmt::format("the inverse threw: {}", exception.what());
    } catch (...) {
      return "the inverse threw";
    }
    if (!is_inverted && !(options_.accept_nearer && ComesNearer())) {
      return why.empty() ? "the inverse failed without a reason" : why;
    }
    if (x_new_.size() != x_.size()) {
      return fmt::format(
          "the inverse returned {} numbers; the simulator has {} inputs",
          x_new_.size(),
          x_.size());
    }
    return Test(inverse.reaches_target());
  }

  // The same by the pseudo-inverse of the J of a linear simulator, whose
  // singular values below max(m, n) epsilon s_max count as zero.
  std::string SolveLinear() {
    const double rounding =
        static_cast<double>(std::max(x_.size(), d_y_.size())) *
        std::numeric_limits<double>::epsilon();
    x_new_.resize(x_.size());
    simulator_.InversePower(1.0, rounding, d_y_.data(), x_new_.data());
    x_new_ += x_;
    return Test(/*reaches_target=*/true);
  }

  // Computes x~ from J; x~ = x if J has no finite value or no candidate is
  // nearer to the target.
  PullBackSource UseJacobian() {
    VectorXd y(simulator_.num_outputs());
    const auto J = simulator_.Linearize(x_.data(), context_.data(), y.data());
    if (J != nullptr) {
      const auto dense = [&J]() {
        MatrixXd matrix;
        J->ToDense(&matrix);
        return matrix;
      };
      x_new_ = x_ + SpectralPullBack(
                        simulator_, dense, d_y_, 1.0, options_.truncation);
      if (ComesNearer()) return PullBackSource::kInverseGradient;
      VectorXd gradient, change;
      J->TransposeTimes(d_y_, &gradient);
      J->Times(gradient, &change);
      const double length = change.stableNorm();
      const double ratio = gradient.stableNorm() / length;
      double t = ratio * ratio;
      for (int i = 0; length > 0.0 && i <= kMaxNumHalvings; ++i, t *= 0.5) {
        x_new_ = x_ + t * gradient;
        if (ComesNearer()) return PullBackSource::kGradient;
      }
    }
    x_new_ = x_;
    return PullBackSource::kNone;
  }

  const VectorXd& x_new() const { return x_new_; }

 private:
  // Returns the reason why x~ cannot be used, else "".
  std::string Test(bool reaches_target) const {
    if (!IsFinite(x_new_)) return "the inverse is not finite";
    if (reaches_target && !ReachesTarget()) {
      return fmt::format("round trip: |P(x~) - y~| is {:.6f} |y~ - y|",
                         DistanceLeft() / distance_);
    }
    return "";
  }

  // Tests an arbitrary x~.
  bool ComesNearer() const {
    return x_new_.size() == x_.size() && IsFinite(x_new_) && x_new_ != x_ &&
           DistanceLeft() < distance_;
  }

  // Tests a finite x~. Close to the target the rounding error of P exceeds any
  // share of |d_y|.
  bool ReachesTarget() const {
    if (options_.accept_nearer) return ComesNearer();
    return DistanceLeft() <= options_.round_trip * distance_ +
                                 kInverseRounding * wanted_.stableNorm();
  }

  // |P(x~) - y~|, infinite if P has no finite value.
  double DistanceLeft() const {
    Scratch<double> y(wanted_.size());
    if (!simulator_.Evaluate(
            x_new_.data(), context_.data(), y.data(), nullptr)) {
      return std::numeric_limits<double>::infinity();
    }
    return (Map<const VectorXd>(y.data(), wanted_.size()) - wanted_)
        .stableNorm();
  }

  const Options& options_;
  const Simulator& simulator_;
  const ConstVectorRef x_;
  const ConstVectorRef context_;
  const ConstVectorRef d_y_;
  const VectorXd wanted_;  // y~
  const double distance_;
  VectorXd x_new_;  // x~
};

bool SimulatorPullBack::operator()(const ConstVectorRef& x,
                                   const ConstVectorRef& context,
                                   const Simulator::Covector& wanted_change,
                                   double* y,
                                   Eigen::Ref<VectorXd> d_x,
                                   Result* result,
                                   const OutputFunction& function) const {
  result->source = PullBackSource::kDerivative;
  result->why.clear();
  if (options_.way == SimulatorWay::kAdjoint) {
    return simulator_->Adjoint(
        x.data(), context.data(), wanted_change, y, d_x.data());
  }
  const Index m = simulator_->num_outputs();
  const Index n = simulator_->num_inputs();
  Scratch<double> d_y_values(m);
  const Map<const VectorXd> d_y(d_y_values.data(), m);
  const bool is_half = options_.way == SimulatorWay::kHalfInverse;
  const bool is_spectral =
      is_half || options_.way == SimulatorWay::kInverseGradient;
  const bool needs_jacobian = is_spectral && !simulator_->is_linear();
  MatrixXd J_transposed(needs_jacobian ? n : 0, m);
  if (!simulator_->Evaluate(x.data(),
                            context.data(),
                            y,
                            needs_jacobian ? J_transposed.data() : nullptr) ||
      !wanted_change(y, d_y_values.data())) {
    return false;
  }
  if (is_spectral) {
    d_x = SpectralPullBack(
        *simulator_,
        [&]() { return J_transposed.transpose(); },
        d_y,
        is_half ? 0.5 : 1.0,
        options_.truncation);
    return AllFinite(d_x.data(), n);
  }
  result->source = inverse_ == nullptr ? PullBackSource::kNumericalInverse
                                       : PullBackSource::kInverse;
  if (!(d_y.array() != 0.0).any()) {
    d_x.setZero();
    return true;
  }
  if (descends()) {
    Descend(x, context, Map<const VectorXd>(y, m) + d_y, function, d_x, result);
    return true;
  }
  Attempt attempt(*this, x, context, Map<const VectorXd>(y, m), d_y);
  if (inverse_ != nullptr) result->why = attempt.Invert(*inverse_);
  if (inverse_ == nullptr || !result->why.empty()) {
    result->source = PullBackSource::kNumericalInverse;
    const std::string why = simulator_->is_linear()
                                ? attempt.SolveLinear()
                                : attempt.Invert(*numerical_);
    if (!why.empty()) {
      result->why += (result->why.empty() ? "" : "; ") + why;
      result->source = attempt.UseJacobian();
    }
  }
  d_x = attempt.x_new() - x;
  return true;
}

void SimulatorPullBack::Descend(const ConstVectorRef& x,
                                const ConstVectorRef& context,
                                const VectorXd& wanted,
                                const OutputFunction& function,
                                Eigen::Ref<VectorXd> d_x,
                                Result* result) const {
  const auto half_squared_distance =
      [&wanted](const double* y, double* F, double* descent) {
        Map<VectorXd> d(descent, wanted.size());
        d = wanted - Map<const VectorXd>(y, wanted.size());
        *F = 0.5 * d.squaredNorm();
        return true;
      };
  const OutputFunction lowered =
      function ? function : OutputFunction(half_squared_distance);
  VectorXd x_new = x;
  const bool has_descended = options_.way == SimulatorWay::kLbfgs
                                 ? DescendByLbfgs(*simulator_,
                                                  context.data(),
                                                  lowered,
                                                  options_.lbfgs,
                                                  &x_new,
                                                  &result->why)
                                 : DescendByGradient(*simulator_,
                                                     context.data(),
                                                     lowered,
                                                     options_.gradient_descent,
                                                     &x_new,
                                                     &result->why);
  result->source =
      has_descended ? PullBackSource::kInverse : PullBackSource::kNone;
  d_x = has_descended ? VectorXd(x_new - x) : VectorXd::Zero(x.size());
}

}  // namespace invgrad
