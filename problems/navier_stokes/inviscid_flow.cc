#include "problems/navier_stokes/inviscid_flow.h"

#include <cmath>
#include <utility>

namespace invgrad {

using Eigen::VectorXd;

namespace {

constexpr auto kMacCormack = AdvectedField::Scheme::kMacCormack;

double MeanSquare(const VectorXd& u) { return u.squaredNorm() / u.size(); }

InviscidFlow::Step::Energy MakeEnergy(double before, double after) {
  if (before == 0.0 || after == 0.0) return {};
  const double scale = std::sqrt(before / after);
  return {scale, 0.5 * scale / before, 0.5 * scale / after};
}

}  // namespace

InviscidFlow::InviscidFlow(int cells, VelocityGrid::Place place, double courant)
    : grid_(cells, cells, place, VelocityGrid::Box::kPeriodic),
      courant_(courant) {}

InviscidFlow::State InviscidFlow::Advance(const State& state,
                                          std::vector<Step>* steps) const {
  const VectorXd& before = state.velocity;
  const auto carried = [&](int c) {
    return AdvectedField(grid_.component(c),
                         kMacCormack,
                         grid_.Component(before, c),
                         courant_ * (grid_.to_component(c) * before));
  };
  std::array<AdvectedField, 2> advected = {carried(0), carried(1)};
  State next;
  next.velocity.resize(grid_.size());
  for (int c = 0; c < 2; ++c) {
    grid_.Part(&next.velocity, c) = advected[c].value();
  }
  VectorXd projected = grid_.Project(next.velocity);
  std::array<Step::Energy, 2> energy;
  for (int c = 0; c < 2; ++c) {
    energy[c] = MakeEnergy(MeanSquare(grid_.Component(before, c)),
                           MeanSquare(grid_.Component(projected, c)));
    grid_.Part(&next.velocity, c) =
        energy[c].scale * grid_.Component(projected, c);
  }
  AdvectedField marker(grid_.cells(),
                       kMacCormack,
                       state.marker,
                       courant_ * (grid_.to_cells() * next.velocity));
  next.marker = marker.value();
  if (steps != nullptr) {
    steps->push_back({std::move(advected),
                      energy,
                      before,
                      std::move(projected),
                      std::move(marker)});
  }
  return next;
}

VectorXd InviscidFlow::Tangent(const std::vector<Step>& steps,
                               VectorXd velocity) const {
  VectorXd marker = VectorXd::Zero(grid_.num_cells());
  VectorXd next(grid_.size());
  for (const Step& step : steps) {
    for (int c = 0; c < 2; ++c) {
      grid_.Part(&next, c) = step.velocity[c].Tangent(
          grid_.Component(velocity, c),
          courant_ * (grid_.to_component(c) * velocity));
    }
    next = grid_.Project(next);
    for (int c = 0; c < 2; ++c) {
      const Step::Energy& energy = step.energy[c];
      const VectorXd projected = grid_.Component(step.projected, c);
      const double two_over_n = 2.0 / projected.size();
      const double scale_change =
          two_over_n *
          (energy.before_slope * grid_.Component(step.before, c)
                                     .dot(grid_.Component(velocity, c)) -
           energy.after_slope * projected.dot(grid_.Component(next, c)));
      grid_.Part(&next, c) =
          energy.scale * grid_.Component(next, c) + scale_change * projected;
    }
    velocity = next;
    marker =
        step.marker.Tangent(marker, courant_ * (grid_.to_cells() * velocity));
  }
  return marker;
}

VectorXd InviscidFlow::PullBack(const std::vector<Step>& steps,
                                VectorXd marker_bar) const {
  VectorXd velocity_bar = VectorXd::Zero(grid_.size());
  for (auto step = steps.rbegin(); step != steps.rend(); ++step) {
    VectorXd before_marker_bar = VectorXd::Zero(grid_.num_cells());
    VectorXd cells_bar = VectorXd::Zero(2 * grid_.num_cells());
    step->marker.Adjoint(marker_bar, &before_marker_bar, &cells_bar);
    marker_bar = before_marker_bar;
    velocity_bar += courant_ * (grid_.to_cells().transpose() * cells_bar);

    VectorXd before_bar(grid_.size());
    for (int c = 0; c < 2; ++c) {
      const Step::Energy& energy = step->energy[c];
      const VectorXd projected = grid_.Component(step->projected, c);
      const VectorXd component_bar = grid_.Component(velocity_bar, c);
      const double two_over_n = 2.0 / projected.size();
      const double scale_bar = two_over_n * component_bar.dot(projected);
      grid_.Part(&before_bar, c) =
          scale_bar * energy.before_slope * grid_.Component(step->before, c);
      grid_.Part(&velocity_bar, c) = energy.scale * component_bar -
                                     scale_bar * energy.after_slope * projected;
    }
    velocity_bar = grid_.Project(velocity_bar);
    for (int c = 0; c < 2; ++c) {
      const int n = grid_.component(c).size();
      VectorXd field_bar = VectorXd::Zero(n);
      VectorXd d_bar = VectorXd::Zero(2 * n);
      step->velocity[c].Adjoint(
          grid_.Component(velocity_bar, c), &field_bar, &d_bar);
      grid_.Part(&before_bar, c) += field_bar;
      before_bar += courant_ * (grid_.to_component(c).transpose() * d_bar);
    }
    velocity_bar = before_bar;
  }
  return velocity_bar;
}

}  // namespace invgrad
