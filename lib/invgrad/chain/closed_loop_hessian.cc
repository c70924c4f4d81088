#include "invgrad/chain/closed_loop_hessian.h"

#include <utility>

#include "glog/logging.h"
#include "invgrad/chain/network_jacobian.h"
#include "invgrad/core/blas.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// S: T ns x T nc, rows t ns .. are ds_t/dx of the open roll-out.
bool StateJacobians(const Feedback& feedback,
                    const double* x,
                    const double* start,
                    MatrixXd* S) {
  const Index num_calls = feedback.num_calls();
  const Index ns = feedback.state_size();
  const Index nc = feedback.control_size();
  MatrixXd M(ns + nc, num_calls * ns);  // row-major, by columns: [A_t B_t]^T
  if (!feedback.StepJacobians(x, start, M.data())) return false;
  S->setZero(num_calls * ns, num_calls * nc);
  for (Index t = 1; t < num_calls; ++t) {
    const auto M_transposed = M.middleCols((t - 1) * ns, ns);
    S->middleRows(t * ns, ns).noalias() =
        M_transposed.topRows(ns).transpose() * S->middleRows((t - 1) * ns, ns);
    S->block(t * ns, (t - 1) * nc, ns, nc) =
        M_transposed.bottomRows(nc).transpose();
  }
  return true;
}

}  // namespace

bool ClosedLoopHessian(const DenseNetwork& network,
                       const Feedback& feedback,
                       const VectorXd& weights,
                       const DenseNetwork::Activations& activations,
                       const MatrixXd& starts,
                       const MatrixXd& lambda,
                       std::vector<MatrixXd> F_xx,
                       MatrixXd* hessian,
                       int* failed) {
  const Index num_calls = feedback.num_calls();
  const Index ns = feedback.state_size();
  const Index nc = feedback.control_size();
  const Index num_x = num_calls * nc;
  const Index batch_size = starts.cols();
  const Index n = network.num_weights();
  CHECK_EQ(activations.batch_size(), batch_size * num_calls);
  CHECK_EQ(lambda.rows(), num_x);
  CHECK_EQ(lambda.cols(), batch_size);
  CHECK_EQ(static_cast<Index>(F_xx.size()), batch_size);

  const MatrixXd covectors = lambda.reshaped(nc, batch_size * num_calls);
  network.Hessian(
      weights,
      activations,
      covectors,
      std::vector<MatrixXd>(activations.batch_size(), MatrixXd::Zero(nc, nc)),
      hessian);

  // X, S, and Lambda without the network's share.
  MatrixXd K;  // |a| x B T nc
  network.InputJacobians(weights, activations, &K);
  std::vector<MatrixXd>& Lambda = F_xx;
  std::vector<MatrixXd> S(batch_size);
  MatrixXd closed = MatrixXd::Identity(num_x, num_x).replicate(1, batch_size);
  MatrixXd state_hessian(num_x, num_x);
  MatrixXd w = MatrixXd::Zero(ns, num_calls);  // of s_1 .. s_T: s_T is not seen
  for (Index s = 0; s < batch_size; ++s) {
    *failed = static_cast<int>(s);
    const double* x = activations.outputs.data() + s * num_x;
    const auto K_s = K.topRows(ns).middleCols(s * num_x, num_x);
    for (Index t = 1; t < num_calls; ++t) {
      w.col(t - 1).noalias() =
          K_s.middleCols(t * nc, nc) * lambda.col(s).segment(t * nc, nc);
    }
    if (!CloseLoop(feedback,
                   x,
                   starts.col(s).data(),
                   K_s,
                   closed.middleCols(s * num_x, num_x)) ||
        !StateJacobians(feedback, x, starts.col(s).data(), &S[s]) ||
        !feedback.StateHessian(
            x, starts.col(s).data(), w.data(), state_hessian.data())) {
      return false;
    }
    Lambda[s] += state_hessian;
  }
  MatrixXd X;  // B |x| x n
  NetworkJacobian(network, weights, activations, std::move(closed)).ToDense(&X);

  // The network's share, one entry of the state after the other.
  MatrixXd C = MatrixXd::Zero(batch_size * num_x, n);
  MatrixXd f_s_s;      // |a| x B T
  MatrixXd f_s_theta;  // n x B T
  for (Index i = 0; i < ns; ++i) {
    network.InputSecondDerivatives(weights,
                                   activations,
                                   covectors,
                                   static_cast<int>(i),
                                   &f_s_s,
                                   &f_s_theta);
    for (Index s = 0; s < batch_size; ++s) {
      MatrixXd S_i(num_calls, num_x);  // row t: ds_{t,i}/dx
      for (Index t = 0; t < num_calls; ++t) {
        const auto S_t = S[s].middleRows(t * ns, ns);
        S_i.row(t) = S_t.row(i);
        Lambda[s].noalias() += S_t.transpose() *
                               f_s_s.col(s * num_calls + t).head(ns) *
                               S_t.row(i);
      }
      Gemm(Op::kTranspose,
           Op::kTranspose,
           1.0,
           S_i,
           f_s_theta.middleCols(s * num_calls, num_calls),
           1.0,
           C.middleRows(s * num_x, num_x));
    }
  }

  // X^T C + C^T X + X^T Lambda X = Z + Z^T with Z = X^T (C + Lambda X / 2).
  for (Index s = 0; s < batch_size; ++s) {
    Gemm(Op::kNone,
         Op::kNone,
         0.5,
         Lambda[s],
         X.middleRows(s * num_x, num_x),
         1.0,
         C.middleRows(s * num_x, num_x));
  }
  MatrixXd Z(n, n);
  Gemm(Op::kTranspose, Op::kNone, 1.0, X, C, 0.0, Z);
  *hessian += Z + Z.transpose();
  return true;
}

}  // namespace invgrad
