#include "invgrad/spectral/golub_kahan.h"

#include <lapacke.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "fmt/core.h"
#include "invgrad/core/finite.h"
#include "invgrad/internal/blas.h"
#include "invgrad/internal/logging.h"
#include "invgrad/spectral/routes/ritz_error.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kRoundoff = std::numeric_limits<double>::epsilon();

// R_k, upper bidiagonal, and the coupling to the next iteration.
struct Bidiagonal {
  std::vector<double> diagonal;       // k
  std::vector<double> superdiagonal;  // k - 1
  std::vector<double> h;              // k: P_k^T g
  double theta = 0.0;                 // |J^T p_k - rho_k v_k|: couples v_{k+1}

  Index size() const { return static_cast<Index>(diagonal.size()); }
};

// The parts of R_k = X Sigma Y^T that the error estimate needs.
bool ComputeRitzValues(const Bidiagonal& R, RitzValues* ritz) {
  const Index k = R.size();
  ritz->s = Eigen::Map<const VectorXd>(R.diagonal.data(), k);
  ritz->c = Eigen::Map<const VectorXd>(R.h.data(), k);
  ritz->residual = VectorXd::Zero(k);
  ritz->residual[k - 1] = 1.0;
  std::vector<double> superdiagonal = R.superdiagonal;
  superdiagonal.resize(k);
  // Applies X to the row e_k^T and X^T to h.
  if (LAPACKE_dbdsqr(LAPACK_COL_MAJOR,
                     'U',
                     k,
                     0,
                     1,
                     1,
                     ritz->s.data(),
                     superdiagonal.data(),
                     nullptr,
                     1,
                     ritz->residual.data(),
                     1,
                     ritz->c.data(),
                     k) != 0) {
    return false;
  }
  ritz->residual *= R.theta;
  return true;
}

// The step in the coordinates of the bases: V_k y with y = Y phi X^T h, or
// P_k z with z = X (phi / s) X^T h, for the leading `size` rows of R.
bool ProjectedStep(const Bidiagonal& R,
                   Index size,
                   const SpectralFilter& filter,
                   double s_max,
                   VectorXd* y,
                   VectorXd* z) {
  VectorXd s = Eigen::Map<const VectorXd>(R.diagonal.data(), size);
  std::vector<double> superdiagonal = R.superdiagonal;
  superdiagonal.resize(size);
  MatrixXd X(size, size);
  MatrixXd Yt(size, size);
  if (LAPACKE_dbdsdc(LAPACK_COL_MAJOR,
                     'U',
                     'I',
                     size,
                     s.data(),
                     superdiagonal.data(),
                     X.data(),
                     size,
                     Yt.data(),
                     size,
                     nullptr,
                     nullptr) != 0) {
    return false;
  }
  VectorXd filtered(size);
  Gemv(Op::kTranspose,
       1.0,
       X,
       Eigen::Map<const VectorXd>(R.h.data(), size),
       0.0,
       filtered);
  for (Index j = 0; j < size; ++j) filtered[j] *= filter(s[j], s_max);
  y->resize(size);
  Gemv(Op::kTranspose, 1.0, Yt, filtered, 0.0, *y);
  for (Index j = 0; j < size; ++j) {
    if (filtered[j] != 0.0) filtered[j] /= s[j];
  }
  z->resize(size);
  Gemv(Op::kNone, 1.0, X, filtered, 0.0, *z);
  return true;
}

void SummarizeSpectrum(const RitzValues& ritz,
                       const SpectralFilter& filter,
                       GolubKahanSummary* summary) {
  summary->s_max = ritz.s[0];
  summary->rank = 0;
  for (const double s : ritz.s) {
    if (!filter.Keeps(s, summary->s_max)) break;
    summary->s_min_kept = s;
    ++summary->rank;
  }
}

// False, with a message, if an entry of `values` or their norm is not finite.
bool CheckNorm(const std::string& name,
               const VectorXd& values,
               double norm,
               std::string* error) {
  if (std::isfinite(norm)) return true;
  if (CheckFinite(name, values, error)) {
    *error = "the norm of " + name + " overflows";
  }
  return false;
}

// Builds R_k and the basis with the shorter columns, P_k or V_k, one iteration
// at a time.
class Bidiagonalization {
 public:
  // Starts from unit vectors g and v_1.
  Bidiagonalization(const JacobianOperator& J,
                    const VectorXd& g,
                    const VectorXd& v,
                    MatrixXd* basis)
      : J_(J),
        g_(g),
        keeps_V_(J.rows() >= J.cols()),
        negligible_(kRoundoff *
                    (8.0 + std::sqrt(std::max(J.rows(), J.cols())))),
        basis_(*basis),
        v_(v) {}

  const Bidiagonal& R() const { return R_; }
  // The Krylov space is invariant.
  bool is_exhausted() const { return is_exhausted_; }

  // False, with a message, if a product with J is not finite.
  bool Advance(std::string* error) {
    // p_k rho_k = J v_k - theta_{k-1} p_{k-1}
    if (keeps_V_) Append(v_);
    J_.Times(v_, &w_);
    if (R_.size() > 0) w_ -= R_.theta * p_;
    if (!keeps_V_) Orthogonalize(&w_);
    double rho = w_.stableNorm();
    if (!CheckNorm("J v", w_, rho, error)) return false;
    if (rho <= negligible_ * J_norm_) {
      // v_k is in the null space of J, up to rounding.
      rho = 0.0;
      p_.setZero(J_.rows());
      is_exhausted_ = true;
    } else {
      p_ = w_ / rho;
    }
    if (!keeps_V_) Append(p_);
    if (R_.size() > 0) R_.superdiagonal.push_back(R_.theta);
    R_.diagonal.push_back(rho);
    R_.h.push_back(p_.dot(g_));

    // v_{k+1} theta_k = J^T p_k - rho_k v_k
    J_.TransposeTimes(p_, &w_);
    w_ -= rho * v_;
    if (keeps_V_) Orthogonalize(&w_);
    R_.theta = w_.stableNorm();
    if (!CheckNorm("J^T p", w_, R_.theta, error)) return false;
    J_norm_ = std::max({J_norm_, rho, R_.theta});
    if (R_.theta <= negligible_ * J_norm_ || R_.size() == J_.cols()) {
      R_.theta = 0.0;
    } else {
      v_ = w_ / R_.theta;
    }
    if (R_.theta == 0.0 || R_.size() == J_.rows()) is_exhausted_ = true;
    return true;
  }

  // V_k y, or the same from P_k z: J^T P_k z = V_k y + theta z_k v_{k+1}.
  VectorXd Step(const VectorXd& y, const VectorXd& z) const {
    VectorXd product(basis_.rows());
    const auto Q = basis_.leftCols(basis_size_);
    Gemv(Op::kNone, 1.0, Q, keeps_V_ ? y : z, 0.0, product);
    if (keeps_V_) return product;
    VectorXd d;
    J_.TransposeTimes(product, &d);
    d -= (R_.theta * z[z.size() - 1]) * v_;
    return d;
  }

 private:
  // Makes *w orthogonal to the basis, with a second pass if cancellation in the
  // first one amplifies rounding errors [Daniel, Gragg, Kaufman, Stewart, Math.
  // Comp. 30 (1976)].
  void Orthogonalize(VectorXd* w) {
    if (basis_size_ == 0) return;
    const auto Q = basis_.leftCols(basis_size_);
    VectorXd coefficients(basis_size_);
    double norm = w->stableNorm();
    for (int pass = 0; pass < 2; ++pass) {
      Gemv(Op::kTranspose, 1.0, Q, *w, 0.0, coefficients);
      Gemv(Op::kNone, -1.0, Q, coefficients, 1.0, *w);
      const double left = w->stableNorm();
      if (left > 0.7 * norm) return;
      norm = left;
    }
  }

  void Append(const VectorXd& q) {
    if (basis_.rows() != q.size() || basis_.cols() == basis_size_) {
      basis_.conservativeResize(q.size(), std::max<Index>(32, 2 * basis_size_));
    }
    basis_.col(basis_size_++) = q;
  }

  const JacobianOperator& J_;
  const VectorXd& g_;
  const bool keeps_V_;
  const double negligible_;  // relative to |J|
  MatrixXd& basis_;          // P_k or V_k in its first columns
  Index basis_size_ = 0;
  Bidiagonal R_;
  VectorXd p_;           // p_k
  VectorXd v_;           // v_{k+1}
  VectorXd w_;           // p_k or v_{k+1} before normalization
  double J_norm_ = 0.0;  // a lower bound of s_max
  bool is_exhausted_ = false;
};

// The projected step by R_k, and its relative difference to that by a slightly
// smaller one. False, with a message, if an SVD does not converge.
bool StepOfR(const Bidiagonal& R,
             const SpectralFilter& filter,
             double s_max,
             VectorXd* y,
             VectorXd* z,
             double* difference,
             std::string* error) {
  const Index k = R.size();
  const Index before = k - std::max<Index>(1, k / 32);
  VectorXd y_before;
  if ((before > 0 && !ProjectedStep(R, before, filter, s_max, &y_before, z)) ||
      !ProjectedStep(R, k, filter, s_max, y, z)) {
    *error = "the SVD of R_k (dbdsdc) did not converge";
    return false;
  }
  VectorXd change = *y;
  change.head(before) -= y_before;
  *difference = change.stableNorm() / y->stableNorm();
  return true;
}

}  // namespace

bool GolubKahanStep(const JacobianOperator& J,
                    const VectorXd& g,
                    const SpectralFilter& filter,
                    const GolubKahanOptions& options,
                    MatrixXd* basis,
                    VectorXd* d,
                    GolubKahanSummary* summary) {
  CHECK_EQ(g.size(), J.rows());
  CHECK_GT(J.rows(), 0);
  CHECK_GT(J.cols(), 0);
  CHECK_GT(options.tolerance, 0.0);
  CHECK_GT(options.max_iterations, 0);
  std::string invalid;
  CHECK(filter.IsValid(&invalid)) << invalid;
  *summary = GolubKahanSummary();
  std::string* error = &summary->message;

  d->setZero(J.cols());
  const double g_norm = g.stableNorm();
  if (!CheckNorm("g", g, g_norm, error)) return false;
  summary->converged = g_norm == 0.0;
  if (summary->converged) return true;
  const VectorXd g_unit = g / g_norm;
  VectorXd v;
  J.TransposeTimes(g_unit, &v);
  const double v_norm = v.stableNorm();
  if (!CheckNorm("J^T g", v, v_norm, error)) return false;
  summary->converged = v_norm == 0.0 || filter.IsGradientDescent();
  if (summary->converged) {
    *d = g_norm * v;
    return CheckFinite("the step", *d, error);
  }
  v /= v_norm;

  Bidiagonalization bidiagonalization(J, g_unit, v, basis);
  const Bidiagonal& R = bidiagonalization.R();
  RitzValues ritz;
  VectorXd y;
  VectorXd z;
  Index next_check = 1;
  for (bool ends = false; !ends;) {
    if (!bidiagonalization.Advance(error)) return false;
    const Index k = R.size();
    const bool exhausted = bidiagonalization.is_exhausted();
    ends = exhausted || k == options.max_iterations;
    if (!ends && k < next_check) continue;
    next_check = k + std::max<Index>(2, k / 16);
    summary->num_iterations = static_cast<int>(k);
    if (!ComputeRitzValues(R, &ritz)) {
      *error = "the SVD of R_k (dbdsqr) did not converge";
      return false;
    }
    SummarizeSpectrum(ritz, filter, summary);
    summary->estimated_error = RitzStepError(ritz, filter, exhausted);
    if (!ends && summary->estimated_error > options.tolerance) continue;
    double difference = 0.0;
    if (!StepOfR(R, filter, summary->s_max, &y, &z, &difference, error)) {
      return false;
    }
    if (!exhausted) summary->estimated_error += difference;
    summary->converged = summary->estimated_error <= options.tolerance;
    ends = ends || summary->converged;
  }

  *d = g_norm * bidiagonalization.Step(y, z);
  if (!summary->converged) {
    *error = fmt::format(
        "golub_kahan: estimated error {:.2g} > {} after {} iterations",
        summary->estimated_error,
        options.tolerance,
        summary->num_iterations);
  }
  return CheckFinite("the step", *d, error);
}

}  // namespace invgrad
