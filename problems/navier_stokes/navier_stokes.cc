#include "problems/navier_stokes/navier_stokes.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "glog/logging.h"

namespace invgrad {

using Eigen::VectorXd;

namespace {

// Of the square of a wave's term.
constexpr double kFloor = 1e-5;

}  // namespace

NavierStokesSimulator::NavierStokesSimulator(
    const NavierStokesSettings& settings)
    : settings_(settings),
      flow_(settings.cells, VelocityGrid::Place::kFaces, settings.courant()) {}

InviscidFlow::State NavierStokesSimulator::Start(const double* x,
                                                 const double* context) const {
  const VelocityGrid& grid = flow_.grid();
  return {Eigen::Map<const VectorXd>(context, num_context()),
          grid.Project(grid.from_cells() *
                       Eigen::Map<const VectorXd>(x, num_inputs()))};
}

std::vector<InviscidFlow::State> NavierStokesSimulator::Run(
    InviscidFlow::State first) const {
  std::vector<InviscidFlow::State> states = {std::move(first)};
  for (int t = 0; t < settings_.kNumSteps; ++t) {
    states.push_back(flow_.Advance(states.back(), nullptr));
  }
  return states;
}

std::vector<InviscidFlow::State> NavierStokesSimulator::RunBack(
    InviscidFlow::State last) const {
  last.velocity *= -1.0;
  std::vector<InviscidFlow::State> states = Run(std::move(last));
  for (InviscidFlow::State& state : states) state.velocity *= -1.0;
  std::reverse(states.begin(), states.end());
  return states;
}

bool NavierStokesSimulator::Value(const double* x,
                                  const double* context,
                                  double* y) const {
  InviscidFlow::State state = Start(x, context);
  for (int t = 0; t < settings_.kNumSteps; ++t) {
    state = flow_.Advance(state, nullptr);
  }
  Eigen::Map<VectorXd>(y, num_outputs()) = state.marker;
  return state.marker.allFinite();
}

std::unique_ptr<const JacobianOperator> NavierStokesSimulator::Linearize(
    const double* x, const double* context, double* y) const {
  auto steps = std::make_shared<std::vector<InviscidFlow::Step>>();
  steps->reserve(settings_.kNumSteps);
  InviscidFlow::State state = Start(x, context);
  for (int t = 0; t < settings_.kNumSteps; ++t) {
    state = flow_.Advance(state, steps.get());
  }
  Eigen::Map<VectorXd>(y, num_outputs()) = state.marker;
  if (!state.marker.allFinite()) return nullptr;
  const auto times = [this, steps](const VectorXd& v, VectorXd* Jv) {
    const VelocityGrid& grid = flow_.grid();
    *Jv = flow_.Tangent(*steps, grid.Project(grid.from_cells() * v));
  };
  const auto transpose_times = [this, steps](const VectorXd& w, VectorXd* Jtw) {
    const VelocityGrid& grid = flow_.grid();
    *Jtw =
        grid.from_cells().transpose() * grid.Project(flow_.PullBack(*steps, w));
  };
  return std::make_unique<FunctionJacobian>(
      num_outputs(), num_inputs(), times, transpose_times);
}

CoarseShapeLoss::CoarseShapeLoss(int cells) : grid_(cells, cells) {
  // 80 cells of 64 a side, in a box of any number of cells.
  const double waves = cells / (2.0 * M_PI);
  weights_ =
      (-0.5 * std::pow(80.0 / 64.0 * waves, 2) * grid_.SquaredWaveNumbers())
          .exp();
  counts_.setConstant(grid_.num_modes(), 2.0);
  const int num_cols = cells / 2 + 1;
  for (int i = 0; i < cells; ++i) {
    counts_[i * num_cols] = 1.0;
    if (cells % 2 == 0) counts_[i * num_cols + cells / 2] = 1.0;
  }
}

Eigen::ArrayXcd CoarseShapeLoss::Modes(const double* y,
                                       const double* target) const {
  const int n = size();
  const VectorXd error =
      Eigen::Map<const VectorXd>(y, n) - Eigen::Map<const VectorXd>(target, n);
  Eigen::ArrayXcd modes(grid_.num_modes());
  grid_.Forward(error.data(), modes.data());
  modes[0] = 0.0;
  return modes;
}

bool CoarseShapeLoss::Counts(int mode, std::complex<double> F) const {
  const double term = weights_[mode] * std::abs(F);
  return term * term > kFloor;
}

bool CoarseShapeLoss::Evaluate(const double* y,
                               const double* target,
                               double* loss,
                               double* gradient,
                               double* hessian) const {
  CHECK(hessian == nullptr) << "this loss has products with its Hessian";
  Eigen::ArrayXcd modes = Modes(y, target);
  if (!modes.allFinite()) return false;
  *loss = 0.0;
  for (int k = 0; k < grid_.num_modes(); ++k) {
    if (!Counts(k, modes[k])) {
      *loss += counts_[k] * std::sqrt(kFloor);
      modes[k] = 0.0;
      continue;
    }
    const double length = std::abs(modes[k]);
    *loss += counts_[k] * weights_[k] * length;
    modes[k] *= weights_[k] / length;
  }
  if (gradient != nullptr) {
    grid_.Backward(modes.data(), gradient);
    Eigen::Map<VectorXd>(gradient, size()) *= size();
  }
  return std::isfinite(*loss);
}

// The second derivative of w |F|: w / |F| times the projection across F.
VectorXd CoarseShapeLoss::HessianTimes(const double* y,
                                       const double* target,
                                       const VectorXd& v) const {
  const Eigen::ArrayXcd modes = Modes(y, target);
  Eigen::ArrayXcd changes(grid_.num_modes());
  grid_.Forward(v.data(), changes.data());
  for (int k = 0; k < grid_.num_modes(); ++k) {
    const std::complex<double> F = modes[k];
    if (!Counts(k, F)) {
      changes[k] = 0.0;
      continue;
    }
    const double along = std::real(std::conj(F) * changes[k]) / std::norm(F);
    changes[k] = weights_[k] / std::abs(F) * (changes[k] - along * F);
  }
  VectorXd product(size());
  grid_.Backward(changes.data(), product.data());
  return size() * product;
}

}  // namespace invgrad
