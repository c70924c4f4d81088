#include "invgrad/chain/roll_out.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/chain/simulator.h"
#include "invgrad/core/scratch.h"

namespace invgrad {

using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

TimeStep::TimeStep(int state_size, int control_size, int output_size)
    : state_size_(state_size),
      control_size_(control_size),
      output_size_(output_size) {
  CHECK_GT(state_size, 0);
  CHECK_GT(control_size, 0);
  CHECK_GE(output_size, 0);
}

bool TimeStep::WeightedHessian(Index /*t*/,
                               const double* /*state*/,
                               const double* /*control*/,
                               const VectorXd& /*covector*/,
                               MatrixXd* /*hessian*/) const {
  LOG(FATAL) << "the step has no WeightedHessian";
  return false;
}

RollOut::RollOut(std::shared_ptr<const TimeStep> step, int num_steps)
    : step_(std::move(step)), num_steps_(num_steps) {
  CHECK(step_ != nullptr);
  CHECK_GT(num_steps, 0);
}

bool RollOut::Run(const double* x,
                  const double* start,
                  double* state,
                  double* outputs) const {
  Scratch<double> next(state_size() + output_size());
  std::copy_n(start, state_size(), state);
  for (Index t = 0; t < num_steps_; ++t) {
    if (!step_->Evaluate(t, state, x + t * control_size(), next.data())) {
      return false;
    }
    std::copy_n(next.data(), state_size(), state);
    std::copy_n(
        next.data() + state_size(), output_size(), outputs + t * output_size());
  }
  return AllFinite(state, state_size()) && AllFinite(outputs, num_outputs());
}

bool RollOut::Linearize(const double* x,
                        const double* start,
                        double* state,
                        double* outputs,
                        double* states,
                        double* G) const {
  const Index ns = state_size();
  Scratch<double> next(ns + output_size());
  std::copy_n(start, ns, state);
  for (Index t = 0; t < num_steps_; ++t) {
    if (states != nullptr) std::copy_n(state, ns, states + t * ns);
    if (!step_->Linearize(t,
                          state,
                          x + t * control_size(),
                          next.data(),
                          G + t * JacobianSize())) {
      return false;
    }
    std::copy_n(next.data(), ns, state);
    std::copy_n(next.data() + ns, output_size(), outputs + t * output_size());
  }
  return AllFinite(state, ns) && AllFinite(outputs, num_outputs()) &&
         AllFinite(G, num_steps_ * JacobianSize());
}

void RollOut::Adjoint(const double* G,
                      const double* w,
                      double* p,
                      double* x_bar) const {
  const Index rows = state_size() + output_size();
  const Index cols = state_size() + control_size();
  Scratch<double> covector(rows);  // [p; w_t]
  Scratch<double> pulled(cols);
  for (Index t = num_steps_ - 1; t >= 0; --t) {
    StackCovectors(t, p, w, covector.data());
    TransposeTimes(
        rows, cols, G + t * rows * cols, covector.data(), pulled.data());
    std::copy_n(pulled.data(), state_size(), p);
    std::copy_n(pulled.data() + state_size(),
                control_size(),
                x_bar + t * control_size());
  }
}

bool RollOut::WeightedHessian(const double* x,
                              const double* start,
                              const double* w,
                              VectorXd p,
                              double* hessian) const {
  using ConstRowMajorMap =
      Map<const Eigen::
              Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
  const Index ns = state_size();
  const Index nc = control_size();
  Scratch<double> state(ns);
  Scratch<double> outputs(num_outputs());
  Scratch<double> states(num_steps_ * ns);
  Scratch<double> G(num_steps_ * JacobianSize());
  if (!Linearize(
          x, start, state.data(), outputs.data(), states.data(), G.data())) {
    return false;
  }
  VectorXd covector(ns + output_size());  // [p; w_t]
  MatrixXd P = MatrixXd::Zero(ns, ns);
  MatrixXd R(ns, num_controls());
  MatrixXd S(ns + nc, ns + nc);
  MatrixXd chained;  // M_t^T R of the later controls
  Map<MatrixXd> H(hessian, num_controls(), num_controls());
  for (Index t = num_steps_ - 1; t >= 0; --t) {
    const ConstRowMajorMap G_t(
        G.data() + t * JacobianSize(), ns + output_size(), ns + nc);
    const auto M_t = G_t.topRows(ns);
    StackCovectors(t, p.data(), w, covector.data());
    if (!step_->WeightedHessian(t, &states[t * ns], x + t * nc, covector, &S)) {
      return false;
    }
    S.noalias() += M_t.transpose() * P * M_t;
    S.triangularView<Eigen::StrictlyUpper>() = S.transpose();  // to the bit
    const Index column = t * nc;
    const Index first_later = column + nc;
    const Index num_later = num_controls() - first_later;
    chained.noalias() = M_t.transpose() * R.rightCols(num_later);
    R.rightCols(num_later) = chained.topRows(ns);
    R.middleCols(column, nc) = S.topRightCorner(ns, nc);
    H.block(column, first_later, nc, num_later) = chained.bottomRows(nc);
    H.block(first_later, column, num_later, nc) =
        chained.bottomRows(nc).transpose();
    H.block(column, column, nc, nc) = S.bottomRightCorner(nc, nc);
    P = S.topLeftCorner(ns, ns);
    p = G_t.leftCols(ns).transpose() * covector;
  }
  return AllFinite(hessian, H.size());
}

void RollOut::StackCovectors(Index t,
                             const double* p,
                             const double* w,
                             double* covector) const {
  std::copy_n(p, state_size(), covector);
  std::copy_n(w + t * output_size(), output_size(), covector + state_size());
}

std::string RollOut::DescribeFailure(const double* x,
                                     const double* start) const {
  Scratch<double> state(state_size());
  Scratch<double> next(state_size() + output_size());
  std::copy_n(start, state_size(), state.data());
  for (Index t = 0; t < num_steps_; ++t) {
    if (!step_->Evaluate(
            t, state.data(), x + t * control_size(), next.data())) {
      return AtTimeStep("the step has no value at", t, num_steps_);
    }
    if (!AllFinite(next.data(), state_size())) {
      return AtTimeStep("the state is not finite after", t, num_steps_);
    }
    if (!AllFinite(next.data() + state_size(), output_size())) {
      return AtTimeStep("the output is not finite at", t, num_steps_);
    }
    std::copy_n(next.data(), state_size(), state.data());
  }
  Scratch<double> outputs(num_outputs());
  Scratch<double> G(num_steps_ * JacobianSize());
  std::fill_n(G.data(),
              num_steps_ * JacobianSize(),
              std::numeric_limits<double>::quiet_NaN());
  Linearize(x, start, state.data(), outputs.data(), nullptr, G.data());
  for (Index t = 0; t < num_steps_; ++t) {
    if (!AllFinite(G.data() + t * JacobianSize(), JacobianSize())) {
      return AtTimeStep("its derivative is not finite at", t, num_steps_);
    }
  }
  return fmt::format(
      "its derivatives are finite at every time step, and not over all {}",
      num_steps_);
}

}  // namespace invgrad
