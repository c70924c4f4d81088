// Fits many right-hand sides y_k at once. Each has its own linear parameters
// c_k, and all share the nonlinear parameters x: a global fit. Use it for
// spectra, decays and the like. For fits without common parameters use
// fit.h, for linear parameters in a ceres::Problem use separable.h.
//
//   minimize 1/2 sum_k |Phi(x) c_k - y_k|^2 = 1/2 |Phi(x) C - Y|_F^2
//
//   struct TwoDecays {  // a spectrum decays alike at each wavelength
//     const std::vector<double>& t;
//     template <typename T>
//     bool operator()(const T* x, T* phi) const {  // columns of Phi
//       using std::exp;
//       for (const double t_i : t) *phi++ = exp(-x[0] * t_i);
//       for (const double t_i : t) *phi++ = exp(-x[1] * t_i);
//       return true;
//     }
//   };
//   GlobalFit<2> fit;
//   fit.nonlinear.x << 1.0, 0.1;                         // the start
//   FitGlobal(FitOptions(), TwoDecays{t}, 2, Y, &fit);
//
// By variable projection with Kaufman's Jacobian (reduced_cost.h), in
// the iteration of internal/levenberg_marquardt.h:
//
//   P = I - Phi Phi^+:  R = -P Y,   C = Phi^+ Y,   J_k = P (dPhi/dx_k) C
//   C^T = Q T:          J_k Q = P (dPhi/dx_k) T^T
//
// One decomposition of Phi serves all right-hand sides. Cost, J^T J and J^T r
// do not change if R and the J_k are multiplied from the right by an orthogonal
// matrix; with Q, J has m p rows in place of m K.
//
// The functor is called with T = ceres::Jet<double, N>. It returns false where
// it has no value.
//
// Shapes:  Phi: m x p, column-major;  Y: m x K;  C: p x K;  x: N.
// Cost:    an iteration evaluates m p features with Jets, and takes 6 m p K
//          operations in matrix products, and few others.
// Threads: those of BLAS; FitOptions::num_threads has no effect.
// Fails:   as FitStatus says; C is then that of the best state, and has no
//          entries if the start is invalid. CHECKs the options and the sizes.
#ifndef INVGRAD_FIT_GLOBAL_H_
#define INVGRAD_FIT_GLOBAL_H_

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/jet.h"
#include "invgrad/internal/blas.h"
#include "invgrad/internal/fit_options.h"
#include "invgrad/internal/levenberg_marquardt.h"
#include "invgrad/internal/linear_projection.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/qr.h"
#include "invgrad/internal/streaming_gram.h"

namespace invgrad {

template <int N>
struct GlobalFit {
  // Of x. num_rows is m K; the covariance is that of x in the fit of x and C.
  FitResult<N> nonlinear;
  Eigen::MatrixXd C;
  int rank = 0;  // of Phi, at x
};

// The residuals of a state, for FitByLevenbergMarquardt.
template <int N, typename Functor>
class GlobalRows {
 public:
  using Jet = ceres::Jet<double, N>;

  GlobalRows(const Functor& functor, int num_features, const Eigen::MatrixXd& Y)
      : functor_(functor), Y_(Y), features_(Y.rows() * num_features) {}

  bool Evaluate(const typename GramRoot<N>::Vector& x, double* cost) {
    Jet jets[N];
    for (int j = 0; j < N; ++j) jets[j] = Jet(x[j], j);
    if (!functor_(jets, features_.data())) return false;
    const Eigen::MatrixXd Phi = Part([](const Jet& jet) { return jet.a; });
    if (!Phi.allFinite()) return false;
    projection_.emplace(Phi, kLinearRankThreshold);
    const Eigen::MatrixXd& Q_1 = projection_->range();
    coordinates_.resize(Q_1.cols(), Y_.cols());
    Gemm(Op::kTranspose, Op::kNone, 1.0, Q_1, Y_, 0.0, coordinates_);
    R_ = -Y_;
    Gemm(Op::kNone, Op::kNone, 1.0, Q_1, coordinates_, 1.0, R_);
    *cost = 0.5 * R_.squaredNorm();
    return true;
  }

  // C, at the last x.
  Eigen::MatrixXd Linear() const {
    return projection_->Solve(projection_->range()) * coordinates_;
  }

  GramRoot<N> Root() {
    const ThinQr qr(Linear().transpose());
    Eigen::MatrixXd RQ(R_.rows(), qr.Q.cols());
    Gemm(Op::kNone, Op::kNone, 1.0, R_, qr.Q, 0.0, RQ);
    Eigen::MatrixXd JQ[N];
    for (int k = 0; k < N; ++k) {
      JQ[k] = projection_->Residual(Part([k](const Jet& jet) {
        return jet.v[k];
      })) * qr.R.transpose();
    }
    gram_.Reset();
    double row[N] = {};
    // What is orthogonal to Q.
    gram_.AddRow(row,
                 std::sqrt(std::max(0.0, R_.squaredNorm() - RQ.squaredNorm())));
    for (Eigen::Index i = 0; i < RQ.size(); ++i) {
      for (int k = 0; k < N; ++k) row[k] = JQ[k].data()[i];
      gram_.AddRow(row, RQ.data()[i]);
    }
    return gram_.Finish();
  }

  // Of Phi or Y.
  int FirstInvalidRow(const typename GramRoot<N>::Vector& x) {
    Jet jets[N];
    for (int j = 0; j < N; ++j) jets[j] = Jet(x[j], j);
    if (!functor_(jets, features_.data())) return 0;
    for (Eigen::Index i = 0; i < Y_.rows(); ++i) {
      if (!Y_.row(i).allFinite()) return static_cast<int>(i);
      for (std::size_t k = i; k < features_.size(); k += Y_.rows()) {
        if (!std::isfinite(features_[k].a) || !features_[k].v.allFinite()) {
          return static_cast<int>(i);
        }
      }
    }
    return -1;
  }

  const LinearProjection& projection() const { return *projection_; }

 private:
  // A part of each feature, m x p.
  template <typename Function>
  Eigen::MatrixXd Part(const Function& part) const {
    const Eigen::Index m = Y_.rows();
    Eigen::MatrixXd matrix(m, static_cast<Eigen::Index>(features_.size()) / m);
    for (Eigen::Index i = 0; i < matrix.size(); ++i) {
      matrix.data()[i] = part(features_[i]);
    }
    return matrix;
  }

  const Functor& functor_;
  const Eigen::MatrixXd& Y_;
  std::vector<Jet> features_;
  std::optional<LinearProjection> projection_;
  Eigen::MatrixXd coordinates_;  // Q_1^T Y, Q_1 of projection_
  Eigen::MatrixXd R_;
  StreamingGram<N> gram_;
};

template <int N, typename Functor>
void FitGlobal(const FitOptions& options,
               const Functor& functor,
               int num_features,
               const Eigen::MatrixXd& Y,
               GlobalFit<N>* fit) {
  std::string error;
  CHECK(options.IsValid(&error)) << error;
  CHECK_GT(num_features, 0);
  CHECK_GT(Y.size(), 0);
  GlobalRows<N, Functor> rows(functor, num_features, Y);
  FitResult<N>& x = fit->nonlinear;
  FitByLevenbergMarquardt<N>(options, &rows, &x);
  fit->C.resize(num_features, 0);
  fit->rank = 0;
  if (x.status == FitStatus::kInvalidStart) return;
  double cost;
  CHECK(rows.Evaluate(x.x, &cost)) << "the functor had a value there before";
  fit->C = rows.Linear();
  fit->rank = rows.projection().rank();
  x.num_rows = Y.size();
  const double freedom =
      static_cast<double>((Y.rows() - fit->rank) * Y.cols() - x.rank);
  x.residual_variance =
      freedom > 0.0 ? 2.0 * x.cost / freedom : FitResult<N>::kNaN;
}

}  // namespace invgrad

#endif  // INVGRAD_FIT_GLOBAL_H_
