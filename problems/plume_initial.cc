#include "problems/plume_initial.h"

#include <cmath>
#include <utility>

#include "glog/logging.h"
#include "invgrad/loss.h"
#include "problems/fields/advection.h"

namespace invgrad {

using Eigen::VectorXd;
using Scheme = AdvectedField::Scheme;

// One step: what was advected.
struct PlumeSimulator::Step {
  AdvectedField marker;
  std::array<AdvectedField, 2> velocity;
};

PlumeSimulator::PlumeSimulator(int rows,
                               int cols,
                               int num_steps,
                               const std::vector<Centre>& inflows)
    : grid_(
          rows, cols, VelocityGrid::Place::kFaces, VelocityGrid::Box::kClosed),
      num_steps_(num_steps) {
  CHECK_GT(num_steps, 0);
  constexpr double kRadius = 3.0;
  constexpr double kRate = 1.0 / 3.0;
  for (const Centre& centre : inflows) {
    VectorXd& inflow = inflows_.emplace_back(rows * cols);
    for (int i = 0; i < rows; ++i) {
      for (int j = 0; j < cols; ++j) {
        const double distance =
            std::hypot(j + 0.5 - centre[0], i + 0.5 - centre[1]);
        inflow[i * cols + j] = distance < kRadius ? kRate : 0.0;
      }
    }
  }
}

PlumeSimulator::State PlumeSimulator::Advance(const State& state,
                                              const VectorXd& inflow,
                                              std::vector<Step>* steps) const {
  const auto carried = [&](int c) {
    return AdvectedField(grid_.component(c),
                         Scheme::kSemiLagrangian,
                         grid_.Component(state.velocity, c),
                         grid_.to_component(c) * state.velocity);
  };
  Step step = {AdvectedField(grid_.cells(),
                             Scheme::kMacCormack,
                             state.marker,
                             grid_.to_cells() * state.velocity),
               {carried(0), carried(1)}};
  State next;
  next.marker = step.marker.value() + inflow;
  VectorXd force = VectorXd::Zero(2 * grid_.num_cells());
  force.tail(grid_.num_cells()) = next.marker;
  VectorXd velocity = grid_.from_cells() * force;
  for (int c = 0; c < 2; ++c) {
    grid_.Part(&velocity, c) += step.velocity[c].value();
  }
  next.velocity = grid_.Project(velocity);
  if (steps != nullptr) steps->push_back(std::move(step));
  return next;
}

VectorXd PlumeSimulator::Tangent(const std::vector<Step>& steps,
                                 const VectorXd& initial) const {
  const int n = grid_.num_cells();
  VectorXd marker = VectorXd::Zero(n);
  VectorXd velocity = initial;
  VectorXd force = VectorXd::Zero(2 * n);
  for (const Step& step : steps) {
    marker = step.marker.Tangent(marker, grid_.to_cells() * velocity);
    force.tail(n) = marker;
    VectorXd next = grid_.from_cells() * force;
    for (int c = 0; c < 2; ++c) {
      grid_.Part(&next, c) += step.velocity[c].Tangent(
          grid_.Component(velocity, c), grid_.to_component(c) * velocity);
    }
    velocity = grid_.Project(next);
  }
  return marker;
}

VectorXd PlumeSimulator::PullBack(const std::vector<Step>& steps,
                                  const VectorXd& final_marker_bar) const {
  const int n = grid_.num_cells();
  VectorXd marker_bar = final_marker_bar;
  VectorXd velocity_bar = VectorXd::Zero(grid_.size());
  for (auto step = steps.rbegin(); step != steps.rend(); ++step) {
    const VectorXd next_bar = grid_.Project(velocity_bar);
    const VectorXd force_bar = grid_.from_cells().transpose() * next_bar;
    marker_bar += force_bar.tail(n);
    velocity_bar.setZero();
    for (int c = 0; c < 2; ++c) {
      VectorXd component_bar = VectorXd::Zero(grid_.component(c).size());
      VectorXd d_bar = VectorXd::Zero(2 * component_bar.size());
      step->velocity[c].Adjoint(
          grid_.Component(next_bar, c), &component_bar, &d_bar);
      grid_.Part(&velocity_bar, c) += component_bar;
      velocity_bar += grid_.to_component(c).transpose() * d_bar;
    }
    VectorXd before_bar = VectorXd::Zero(n);
    VectorXd d_bar = VectorXd::Zero(2 * n);
    step->marker.Adjoint(marker_bar, &before_bar, &d_bar);
    velocity_bar += grid_.to_cells().transpose() * d_bar;
    marker_bar = before_bar;
  }
  return velocity_bar;
}

bool PlumeSimulator::Value(const double* x,
                           const double* /*context*/,
                           double* y) const {
  const int n = grid_.num_cells();
  for (size_t k = 0; k < inflows_.size(); ++k) {
    State state = {
        VectorXd::Zero(n),
        Eigen::Map<const VectorXd>(x + k * grid_.size(), grid_.size())};
    for (int t = 0; t < num_steps_; ++t) {
      state = Advance(state, inflows_[k], nullptr);
    }
    Eigen::Map<VectorXd>(y + k * n, n) = state.marker;
  }
  return AllFinite(y, num_outputs());
}

std::unique_ptr<const JacobianOperator> PlumeSimulator::Linearize(
    const double* x, const double* /*context*/, double* y) const {
  const int n = grid_.num_cells();
  const int size = grid_.size();
  auto runs = std::make_shared<std::vector<std::vector<Step>>>();
  for (size_t k = 0; k < inflows_.size(); ++k) {
    State state = {VectorXd::Zero(n),
                   Eigen::Map<const VectorXd>(x + k * size, size)};
    runs->emplace_back().reserve(num_steps_);
    for (int t = 0; t < num_steps_; ++t) {
      state = Advance(state, inflows_[k], &runs->back());
    }
    Eigen::Map<VectorXd>(y + k * n, n) = state.marker;
  }
  if (!AllFinite(y, num_outputs())) return nullptr;
  const auto times = [this, runs, n, size](const VectorXd& v, VectorXd* Jv) {
    Jv->resize(num_outputs());
    for (size_t k = 0; k < runs->size(); ++k) {
      Jv->segment(k * n, n) = Tangent((*runs)[k], v.segment(k * size, size));
    }
  };
  const auto transpose_times = [this, runs, n, size](const VectorXd& w,
                                                     VectorXd* Jtw) {
    Jtw->resize(num_inputs());
    for (size_t k = 0; k < runs->size(); ++k) {
      Jtw->segment(k * size, size) = PullBack((*runs)[k], w.segment(k * n, n));
    }
  };
  return std::make_unique<FunctionJacobian>(
      num_outputs(), num_inputs(), times, transpose_times);
}

bool PlumeInitial::Create(PointProblem* problem, std::string* /*error*/) const {
  constexpr int kRows = 40;
  constexpr int kCols = 32;
  constexpr int kSteps = 20;
  const std::vector<PlumeSimulator::Centre> inflows = {
      {12.0, 4.0}, {13.0, 6.0}, {14.0, 5.0}};
  const auto simulator =
      std::make_shared<PlumeSimulator>(kRows, kCols, kSteps, inflows);
  const PlumeSimulator wanted(kRows, kCols, kSteps, {{16.0, 5.0}});
  const VectorXd at_rest = VectorXd::Zero(wanted.num_inputs());
  VectorXd target(wanted.num_outputs());
  CHECK(wanted.Value(at_rest.data(), nullptr, target.data()));
  problem->target = target.replicate(inflows.size(), 1);
  problem->start = VectorXd::Zero(simulator->num_inputs());
  problem->loss =
      std::make_shared<SquaredNormLoss>(simulator->num_outputs(), 0.5);
  problem->simulator = simulator;
  return true;
}

}  // namespace invgrad
