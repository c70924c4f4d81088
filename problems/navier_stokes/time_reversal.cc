#include "problems/navier_stokes/time_reversal.h"

#include <utility>
#include <vector>

namespace invgrad {

using Eigen::Vector2d;
using Eigen::VectorXd;

namespace {

double Cross(const Vector2d& a, const Vector2d& b) {
  return a[0] * b[1] - a[1] * b[0];
}

}  // namespace

TimeReversal::TimeReversal(
    std::shared_ptr<const NavierStokesSimulator> simulator, Way way)
    : simulator_(std::move(simulator)), way_(way) {
  const NavierStokesSettings& settings = simulator_->settings();
  const int cells = settings.cells;
  const int n = cells * cells;
  unit_swirl_.resize(2 * n);
  for (int cell = 0; cell < n; ++cell) {
    const int row = cell / cells;
    const int col = cell % cells;
    unit_swirl_[cell] = -settings.dx() * (row + 0.5 - 0.5 * cells);
    unit_swirl_[n + cell] = settings.dx() * (col + 0.5 - 0.5 * cells);
  }
  unit_swirl_ /=
      unit_swirl_.dot(SwirlVelocity(Vector2d::Zero(), 1.0, settings));
}

double TimeReversal::SwirlStrength(const VectorXd& x) const {
  return unit_swirl_.dot(x);
}

bool TimeReversal::Invert(const ConstVectorRef& y,
                          const ConstVectorRef& x_now,
                          const ConstVectorRef& context,
                          VectorXd* x,
                          std::string* why) const {
  const NavierStokesSettings& settings = simulator_->settings();
  const int num_steps = settings.kNumSteps;
  const std::vector<InviscidFlow::State> forward =
      simulator_->Run(simulator_->Start(x_now.data(), context.data()));
  const std::vector<InviscidFlow::State> backward =
      simulator_->RunBack({y, forward.back().velocity});
  const Vector2d middle = Vector2d::Constant(settings.kSide / 2.0);
  const Vector2d way = middle - CentreOfMass(context, settings);
  double torque = 0.0;
  for (int t = 0; t <= num_steps; ++t) {
    double share = 1.0 * t / num_steps;
    if (way_ == Way::kReleased && t < num_steps) share = t / settings.kTime;
    const Vector2d S = middle + way * share;
    const Vector2d C = CentreOfMass(forward[t].marker, settings);
    const Vector2d R = CentreOfMass(backward[t].marker, settings);
    torque += Cross(C - R, R - S);
  }
  const double omega = SwirlStrength(x_now) + 1e-3 * torque / (num_steps + 1);
  *x = SwirlVelocity(way / settings.kTime, omega, settings);
  if (x->allFinite()) return true;
  *why = "a marker is empty, or the flow is not finite";
  return false;
}

}  // namespace invgrad
