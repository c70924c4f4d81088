#include "problems/navier_stokes/navier_stokes.h"

#include <cmath>
#include <utility>

#include "glog/logging.h"

namespace invgrad {

using Eigen::VectorXd;

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
    InviscidFlow::State state) const {
  std::vector<InviscidFlow::State> states = {std::move(state)};
  for (int t = 0; t < settings_.kNumSteps; ++t) {
    states.push_back(flow_.Advance(states.back(), nullptr));
  }
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

bool CoarseShapeLoss::Evaluate(const double* y,
                               const double* target,
                               double* loss,
                               double* gradient,
                               double* hessian) const {
  constexpr double kFloor = 1e-5;
  const int n = size();
  const VectorXd error =
      Eigen::Map<const VectorXd>(y, n) - Eigen::Map<const VectorXd>(target, n);
  if (!error.allFinite()) return false;
  if (hessian != nullptr) Eigen::Map<Eigen::MatrixXd>(hessian, n, n).setZero();
  Eigen::ArrayXcd modes(grid_.num_modes());
  grid_.Forward(error.data(), modes.data());
  modes[0] = 0.0;
  *loss = 0.0;
  for (int k = 0; k < grid_.num_modes(); ++k) {
    const double length = std::abs(modes[k]);
    const double term = weights_[k] * length;
    if (term * term <= kFloor) {
      *loss += counts_[k] * std::sqrt(kFloor);
      modes[k] = 0.0;
      continue;
    }
    *loss += counts_[k] * term;
    if (hessian != nullptr) {
      AddHessian(k, counts_[k] * weights_[k], modes[k], hessian);
    }
    modes[k] *= weights_[k] / length;
  }
  if (gradient != nullptr) {
    grid_.Backward(modes.data(), gradient);
    Eigen::Map<VectorXd>(gradient, n) *= n;
  }
  return std::isfinite(*loss);
}

// The second derivative of weight |F|: weight / |F| q q^T, q the derivative of
// F across its own direction.
void CoarseShapeLoss::AddHessian(int mode,
                                 double weight,
                                 std::complex<double> F,
                                 double* hessian) const {
  const int cells = grid_.rows();
  const int num_cols = cells / 2 + 1;
  VectorXd q(size());
  for (int p = 0; p < size(); ++p) {
    const int turns =
        mode / num_cols * (p / cells) + mode % num_cols * (p % cells);
    const double phase = 2.0 * M_PI / cells * turns;
    q[p] =
        (F.imag() * std::cos(phase) + F.real() * std::sin(phase)) / std::abs(F);
  }
  Eigen::Map<Eigen::MatrixXd>(hessian, size(), size()) +=
      weight / std::abs(F) * q * q.transpose();
}

}  // namespace invgrad
