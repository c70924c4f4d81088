#include "invgrad/chain/feedback.h"

#include "glog/logging.h"
#include "invgrad/core/scratch.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;

bool CloseLoop(const Feedback& feedback,
               const double* x,
               const double* start,
               const Eigen::Ref<const MatrixXd>& K,
               Eigen::Ref<MatrixXd> x_bar) {
  const Index num_calls = feedback.num_calls();
  const Index ns = feedback.state_size();
  const Index nc = feedback.control_size();
  CHECK_EQ(K.rows(), ns);
  CHECK_EQ(K.cols(), num_calls * nc);
  CHECK_EQ(x_bar.rows(), num_calls * nc);
  const Index size = ns + nc;
  Scratch<double> M(num_calls * ns * size);
  if (!feedback.StepJacobians(x, start, M.data())) return false;
  Scratch<double> memory(2 * ns * x_bar.cols());
  // Covectors of s_{t+1} and of s_t, one per column.
  Eigen::Map<MatrixXd> p(memory.data(), ns, x_bar.cols());
  Eigen::Map<MatrixXd> pulled(memory.data() + p.size(), ns, x_bar.cols());
  p.setZero();
  for (Index t = num_calls - 1; t >= 0; --t) {
    // A row-major M_t, read by columns.
    const Eigen::Map<const MatrixXd> M_transposed(
        M.data() + t * ns * size, size, ns);
    auto x_bar_t = x_bar.middleRows(t * nc, nc);
    x_bar_t.noalias() += M_transposed.bottomRows(nc) * p;
    pulled.noalias() = M_transposed.topRows(ns) * p;
    pulled.noalias() += K.middleCols(t * nc, nc) * x_bar_t;
    p = pulled;
  }
  return x_bar.allFinite();
}

}  // namespace invgrad
