#include "invgrad/chain/stepped_simulator.h"

#include <algorithm>
#include <limits>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/core/blas.h"
#include "invgrad/core/scratch.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Below this state size plain loops are faster than BLAS: 80 ns against 94 at
// size 6, but 183 against 108 at 8.
constexpr Index kSmallState = 7;

// pulled = A^T w for a row-major A, by sums in registers, which is fastest for
// the sizes of one time step.
void TransposeTimes(
    Index rows, Index cols, const double* A, const double* w, double* pulled) {
  for (Index k = 0; k < cols; ++k) {
    double sum = 0.0;
    for (Index i = 0; i < rows; ++i) sum += A[i * cols + k] * w[i];
    pulled[k] = sum;
  }
}

}  // namespace

SteppedSimulator::SteppedSimulator(int state_size,
                                   int control_size,
                                   int output_size,
                                   int num_steps)
    : state_size_(state_size),
      control_size_(control_size),
      output_size_(output_size),
      num_steps_(num_steps) {
  CHECK_GT(state_size, 0);
  CHECK_GT(control_size, 0);
  CHECK_GE(output_size, 0);
  CHECK_GT(num_steps, 0);
}

bool SteppedSimulator::RollOut(const double* x,
                               const double* start,
                               Index rows,
                               double* y,
                               double* states,
                               double* G) const {
  const Index ns = state_size_;
  const Index no = rows - ns;
  const Index jacobian_size = rows * (ns + control_size_);
  Scratch<double> state(ns);
  Scratch<double> next(rows);
  std::copy_n(start, ns, state.data());
  for (Index t = 0; t < num_steps_; ++t) {
    const double* control = x + t * control_size_;
    if (states != nullptr) std::copy_n(state.data(), ns, states + t * ns);
    if (!(G == nullptr ? Step(t, state.data(), control, rows, next.data())
                       : LinearizeStep(t,
                                       state.data(),
                                       control,
                                       rows,
                                       next.data(),
                                       G + t * jacobian_size))) {
      return false;
    }
    std::copy_n(next.data(), ns, state.data());
    std::copy_n(next.data() + ns, no, y + t * no);
  }
  if (no == 0) std::copy_n(state.data(), ns, y);
  return AllFinite(state.data(), ns) && AllFinite(y, num_steps_ * no) &&
         (G == nullptr || AllFinite(G, num_steps_ * jacobian_size));
}

bool SteppedSimulator::Evaluate(const double* x,
                                const double* context,
                                double* y,
                                double* jacobian) const {
  const Index rows = state_size_ + output_size_;
  if (jacobian == nullptr) {
    return RollOut(x, context, rows, y, nullptr, nullptr);
  }
  Scratch<double> G(num_steps_ * rows * (state_size_ + control_size_));
  if (!RollOut(x, context, rows, y, nullptr, G.data())) return false;
  if (output_size_ == 0) {
    ChainToEnd(G.data(), jacobian);
  } else {
    ChainToOutputs(G.data(), jacobian);
  }
  return AllFinite(jacobian, Index{num_outputs()} * num_inputs());
}

void SteppedSimulator::ChainToEnd(const double* G, double* jacobian) const {
  const Index ns = state_size_;
  const Index nc = control_size_;
  const Index size = ns + nc;
  // Both by rows: C, and C M_t = [C A_t, C B_t].
  Scratch<double> C(ns * ns);
  Scratch<double> CM(ns * size);
  Map<MatrixXd>(C.data(), ns, ns).setIdentity();
  for (Index t = num_steps_ - 1; t >= 0; --t) {
    const double* M_t = G + t * ns * size;
    if (ns < kSmallState) {
      for (Index i = 0; i < ns; ++i) {
        TransposeTimes(ns, size, M_t, C.data() + i * ns, CM.data() + i * size);
      }
    } else {
      Gemm(Op::kNone,
           Op::kNone,
           1.0,
           Map<const MatrixXd>(M_t, size, ns),
           Map<const MatrixXd>(C.data(), ns, ns),
           0.0,
           Map<MatrixXd>(CM.data(), size, ns));
    }
    for (Index i = 0; i < ns; ++i) {
      const double* row = CM.data() + i * size;
      std::copy(row, row + ns, C.data() + i * ns);
      std::copy(row + ns, row + size, jacobian + (i * num_steps_ + t) * nc);
    }
  }
}

void SteppedSimulator::ChainToOutputs(const double* G, double* jacobian) const {
  const Index ns = state_size_;
  const Index nc = control_size_;
  const Index no = output_size_;
  const Index num_x = num_inputs();
  const Index rows = ns + no;
  // Transposed, because row-major matrices are accessed by columns. The columns
  // of (dz_t/dx)^T follow the columns of W^T and are then copied to J.
  Map<MatrixXd> J(jacobian, num_x, num_outputs());
  J.setZero();
  Scratch<double> memory((ns + rows) * num_x);
  Map<MatrixXd> W(memory.data(), num_x, ns);
  Map<MatrixXd> next(memory.data() + W.size(), num_x, rows);
  for (Index t = 0; t < num_steps_; ++t) {
    const Map<const MatrixXd> G_t(G + t * rows * (ns + nc), ns + nc, rows);
    const Index num_earlier = t * nc;
    if (t > 0) {
      Gemm(Op::kNone,
           Op::kNone,
           1.0,
           W.topRows(num_earlier),
           G_t.topRows(ns),
           0.0,
           next.topRows(num_earlier));
    }
    next.middleRows(num_earlier, nc) = G_t.bottomRows(nc);
    const Index num_rows = num_earlier + nc;
    W.topRows(num_rows) = next.topLeftCorner(num_rows, ns);
    J.middleCols(t * no, no).topRows(num_rows) =
        next.topRightCorner(num_rows, no);
  }
}

bool SteppedSimulator::Adjoint(const double* x,
                               const double* context,
                               const Covector& covector,
                               double* y,
                               double* x_bar) const {
  const Index ns = state_size_;
  const Index nc = control_size_;
  const Index no = output_size_;
  const Index rows = ns + no;
  const Index size = ns + nc;
  Scratch<double> G(num_steps_ * rows * size);
  Scratch<double> w(num_outputs());
  if (!RollOut(x, context, rows, y, nullptr, G.data()) ||
      !covector(y, w.data())) {
    return false;
  }
  Scratch<double> stacked(rows);  // [p; w_t]
  Scratch<double> pulled(size);
  std::fill_n(stacked.data(), ns, 0.0);
  if (no == 0) std::copy_n(w.data(), ns, stacked.data());
  for (Index t = num_steps_ - 1; t >= 0; --t) {
    std::copy_n(w.data() + t * no, no, stacked.data() + ns);
    TransposeTimes(
        rows, size, G.data() + t * rows * size, stacked.data(), pulled.data());
    std::copy_n(pulled.data(), ns, stacked.data());
    std::copy_n(pulled.data() + ns, nc, x_bar + t * nc);
  }
  return AllFinite(x_bar, num_inputs());
}

bool SteppedSimulator::WeightedHessian(const double* x,
                                       const double* context,
                                       const double* w,
                                       double* hessian) const {
  using ConstRowMajorMap =
      Map<const Eigen::
              Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
  const Index ns = state_size_;
  const Index nc = control_size_;
  const Index no = output_size_;
  const Index size = ns + nc;
  const Index num_x = num_inputs();
  Scratch<double> y(num_outputs());
  Scratch<double> states(num_steps_ * ns);
  Scratch<double> G(num_steps_ * (ns + no) * size);
  if (!RollOut(x, context, ns + no, y.data(), states.data(), G.data())) {
    return false;
  }
  VectorXd stacked = VectorXd::Zero(ns + no);  // [p; w_t]
  if (no == 0) stacked = Map<const VectorXd>(w, ns);
  MatrixXd P = MatrixXd::Zero(ns, ns);
  MatrixXd R(ns, num_x);
  MatrixXd S(size, size);
  MatrixXd chained;  // M_t^T R of the later controls
  Map<MatrixXd> H(hessian, num_x, num_x);
  for (Index t = num_steps_ - 1; t >= 0; --t) {
    const ConstRowMajorMap G_t(G.data() + t * (ns + no) * size, ns + no, size);
    const auto M_t = G_t.topRows(ns);
    stacked.tail(no) = Map<const VectorXd>(w + t * no, no);
    if (!StepHessian(t, &states[t * ns], x + t * nc, stacked, &S)) return false;
    S.noalias() += M_t.transpose() * P * M_t;
    S.triangularView<Eigen::StrictlyUpper>() = S.transpose();  // bit for bit
    const Index column = t * nc;
    const Index first_later = column + nc;
    const Index num_later = num_x - first_later;
    chained.noalias() = M_t.transpose() * R.rightCols(num_later);
    R.rightCols(num_later) = chained.topRows(ns);
    R.middleCols(column, nc) = S.topRightCorner(ns, nc);
    H.block(column, first_later, nc, num_later) = chained.bottomRows(nc);
    H.block(first_later, column, num_later, nc) =
        chained.bottomRows(nc).transpose();
    H.block(column, column, nc, nc) = S.bottomRightCorner(nc, nc);
    P = S.topLeftCorner(ns, ns);
    stacked.head(ns) = G_t.leftCols(ns).transpose() * stacked;
  }
  return AllFinite(hessian, H.size());
}

std::string SteppedSimulator::DescribeFailure(const double* x,
                                              const double* context) const {
  const Index ns = state_size_;
  const Index no = output_size_;
  Scratch<double> state(ns);
  Scratch<double> next(ns + no);
  std::copy_n(context, ns, state.data());
  for (Index t = 0; t < num_steps_; ++t) {
    if (!Step(t, state.data(), x + t * control_size_, ns + no, next.data())) {
      return AtTimeStep("the step has no value at", t, num_steps_);
    }
    if (!AllFinite(next.data(), ns)) {
      return AtTimeStep("the state is not finite after", t, num_steps_);
    }
    if (!AllFinite(next.data() + ns, no)) {
      return AtTimeStep("the output is not finite at", t, num_steps_);
    }
    std::copy_n(next.data(), ns, state.data());
  }
  const Index jacobian_size = (ns + no) * (ns + control_size_);
  Scratch<double> y(num_outputs());
  Scratch<double> G(num_steps_ * jacobian_size);
  std::fill_n(G.data(),
              num_steps_ * jacobian_size,
              std::numeric_limits<double>::quiet_NaN());
  RollOut(x, context, ns + no, y.data(), nullptr, G.data());
  for (Index t = 0; t < num_steps_; ++t) {
    if (!AllFinite(G.data() + t * jacobian_size, jacobian_size)) {
      return AtTimeStep("its derivative is not finite at", t, num_steps_);
    }
  }
  return fmt::format(
      "its derivatives are finite at every time step, and not over all {}",
      num_steps_);
}

bool SteppedSimulator::Advance(const double* state,
                               const double* control,
                               double* next_state) const {
  return Step(0, state, control, state_size_, next_state) &&
         AllFinite(next_state, state_size_);
}

bool SteppedSimulator::StepJacobians(const double* x,
                                     const double* start,
                                     double* M) const {
  Scratch<double> end(state_size_);
  return RollOut(x, start, state_size_, end.data(), nullptr, M);
}

}  // namespace invgrad
