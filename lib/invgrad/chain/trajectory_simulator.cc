#include "invgrad/chain/trajectory_simulator.h"

#include <algorithm>

#include "glog/logging.h"
#include "invgrad/core/blas.h"
#include "invgrad/core/scratch.h"

namespace invgrad {

using Eigen::Map;
using Eigen::MatrixXd;

TrajectoryBase::TrajectoryBase(RollOut roll_out, RollOut states)
    : SteppedSimulator(std::move(states)), roll_out_(std::move(roll_out)) {
  CHECK_GT(roll_out_.output_size(), 0);
}

bool TrajectoryBase::Evaluate(const double* x,
                              const double* context,
                              double* y,
                              double* jacobian) const {
  const Index ns = roll_out_.state_size();
  Scratch<double> state(ns);
  if (jacobian == nullptr) return roll_out_.Run(x, context, state.data(), y);
  const Index nc = roll_out_.control_size();
  const Index no = roll_out_.output_size();
  const Index num_x = num_inputs();
  const Index size = ns + nc;
  Scratch<double> G(roll_out_.num_steps() * roll_out_.JacobianSize());
  if (!roll_out_.Linearize(x, context, state.data(), y, nullptr, G.data())) {
    return false;
  }
  // Transposed, because row-major matrices are accessed by columns. The columns
  // of (dz_t/dx)^T follow the columns of W^T and are then copied to J.
  Map<MatrixXd> J(jacobian, num_x, num_outputs());
  J.setZero();
  Scratch<double> memory((2 * ns + no) * num_x);
  Map<MatrixXd> W(memory.data(), num_x, ns);
  Map<MatrixXd> next(memory.data() + W.size(), num_x, ns + no);
  for (Index t = 0; t < roll_out_.num_steps(); ++t) {
    const Map<const MatrixXd> G_t(
        G.data() + t * roll_out_.JacobianSize(), size, ns + no);
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
  return AllFinite(jacobian, J.size());
}

bool TrajectoryBase::Adjoint(const double* x,
                             const double* context,
                             const Covector& covector,
                             double* y,
                             double* x_bar) const {
  Scratch<double> G(roll_out_.num_steps() * roll_out_.JacobianSize());
  Scratch<double> w(num_outputs());
  Scratch<double> p(state_size());  // s_N, then its covector
  if (!roll_out_.Linearize(x, context, p.data(), y, nullptr, G.data()) ||
      !covector(y, w.data())) {
    return false;
  }
  std::fill_n(p.data(), state_size(), 0.0);
  roll_out_.Adjoint(G.data(), w.data(), p.data(), x_bar);
  return AllFinite(x_bar, num_inputs());
}

bool TrajectoryBase::WeightedHessian(const double* x,
                                     const double* context,
                                     const double* w,
                                     double* hessian) const {
  return roll_out_.WeightedHessian(
      x, context, w, Eigen::VectorXd::Zero(state_size()), hessian);
}

std::string TrajectoryBase::DescribeFailure(const double* x,
                                            const double* context) const {
  return roll_out_.DescribeFailure(x, context);
}

}  // namespace invgrad
