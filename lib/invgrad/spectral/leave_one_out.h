// What a spectral step does for samples that it was not computed from.
//
//   step = -eta J^T psi(G) g,   G = J J^T,   psi(l) = (l + lambda)^-p,
//   p = (1 + kappa) / 2
//
// c_i is the change of the outputs of sample i by the step (with eta = -1) that
// all other samples of the batch give:
//
//   c_i = J_i J_-i^T psi(G_-i,-i) g_-i
//       = sum_j w_j (g_i - (C_j)_ii^-1 (C_j g)_i),   C_j = (G + lambda + z_j)^-1
//
// for psi(l) = sum_j w_j / (l + lambda + z_j), which stieltjes_quadrature.h
// gives for every p; docs/leave_one_out.md proves it. lambda is that of the whole
// batch, also where it is relative to s_max.
//
// Filters. Only damped powers are such sums, without a Wiener factor (noise). A
// truncated or clamped filter
// (tau > 0) is judged by the damped power with tau^2 s_max^2 added to lambda.
// kappa = -1 is gradient descent whatever tau and lambda are.
//
// Where J J^T has values that are not resolved from zero (n < m, or rank
// deficient), lambda is at least sqrt(resolution l_min) s_max: l_min the
// smallest resolved value, resolution as in spectral_step.h, relative to s_max^2.
// Closer to zero rounding decides. summary.message says what was replaced.
//
// Shapes:  J: m x n;  g, c: m; samples: consecutive rows of J, any number each.
// Units:   c: those of psi(G) G g.
// Cost:    Factorize: a step of route gram (spectral_step.h) without its function,
//          by one stage, and 2 k^2 for each row of the chosen samples,
//          k = min(m, n); for n < m a dense J.  Evaluate: for each shift,
//          k (|y|^2 / 2 + 4 |y|) for each chosen sample. Filters of the same
//          lambda share all shifts but two.
// Memory:  three matrices of k^2, and k for each chosen row.
// Accuracy: with |J_i| the norm of the sample's rows and s any singular value up
//          to s_max, but for rounding:
//          |error of c_i| <= quadrature_error |J_i| max s psi(s^2) |g|
// Fails:   Factorize returns false, with a message, if g or J is not finite, if
//          the squares of J's entries over- or underflow, if the memory does not
//          suffice, or if ranks share J; Evaluate if a c overflows. One sample
//          alone, J = 0 and g = 0 give c = 0. CHECKs sizes and filters.
#ifndef INVGRAD_SPECTRAL_LEAVE_ONE_OUT_H_
#define INVGRAD_SPECTRAL_LEAVE_ONE_OUT_H_

#include <functional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/jacobian_operator.h"
#include "invgrad/spectral/routes/tridiagonalization.h"
#include "invgrad/spectral/spectral_filter.h"

namespace invgrad {

struct LeaveOneOutOptions {
  // The largest relative error of psi as a sum, in (0, 1).
  double tolerance = 1e-8;
  // At most that many samples, evenly spaced, have a c_i; 0: all. The samples
  // that are left in are always all others.
  int max_num_samples = 0;
  // v -> H_L v, both m (linearization.h). Empty: H_L is the identity.
  std::function<Eigen::VectorXd(const Eigen::VectorXd&)> loss_hessian_times;
  // In bytes; 0: the limit of memory_limit.h.
  double memory_limit = 0.0;
};

// Sums over the chosen samples. Those of several steps may be added up.
struct LeaveOneOutScore {
  double g_c = 0.0;       // g . c
  double c_c = 0.0;       // |c|^2
  double c_H_c = 0.0;     // c . H_L c
  double g_g = 0.0;       // |g|^2
  double g_fitted = 0.0;  // g . G psi(G) g: c with no sample left out

  LeaveOneOutScore& operator+=(const LeaveOneOutScore& other);

  // The eta that is best for a fresh sample, g.c / c.H_L c; 0 if no eta > 0
  // helps.
  double StepSize() const;
  // The share of |g|^2 / 2 that a fresh sample loses at this eta, for H_L a
  // multiple of the identity: (g.c)^2 / (|c|^2 |g|^2), 0 if no eta > 0 helps.
  double RelativeDecrease() const;
  // gamma = g.c / g.G psi(G) g: near 1 if a fresh sample gets what the batch
  // gets, near 0 if only the batch does. 0 for g = 0.
  double Generalization() const;
};

struct LeaveOneOutSummary {
  double damping = 0.0;  // lambda, with what replaces tau, in units of s^2
  int num_shifts = 0;
  double quadrature_error = 0.0;  // relative, of psi
  LeaveOneOutScore score;
  std::string message;  // the failure, or what was replaced
};

// Judges many filters by one factorization. Reuses its memory.
class LeaveOneOut {
 public:
  // rows_of_samples: the number of rows of each sample, all > 0, with sum m.
  bool Factorize(const JacobianOperator& J,
                 const Eigen::VectorXd& g,
                 const std::vector<int>& rows_of_samples,
                 const LeaveOneOutOptions& options,
                 std::string* message);

  // The numbers of the chosen samples, ascending.
  const std::vector<int>& chosen() const { return chosen_; }

  // Column k of *changes is c for filters[k], zero in the rows of samples that
  // are not chosen. After Factorize returned true (CHECKed).
  bool Evaluate(const std::vector<SpectralFilter>& filters,
                Eigen::MatrixXd* changes,
                std::vector<LeaveOneOutSummary>* summaries) const;

 private:
  // A filter as a sum over the shifts of all filters.
  struct Mixture {
    double exponent = 0.0;
    std::vector<int> indices;
    std::vector<double> weights;
  };

  void ReadSpectrum();
  Mixture MixtureOf(const SpectralFilter& filter,
                    std::vector<double>* shifts,
                    LeaveOneOutSummary* summary) const;
  // The gradient's c_i and (G g)_i.
  void LeaveOutOfGradient(const Eigen::Ref<const Eigen::MatrixXd>& W,
                          const Eigen::Ref<const Eigen::VectorXd>& g_i,
                          Eigen::VectorXd* left_out,
                          Eigen::VectorXd* fitted) const;
  void SumUp(const Eigen::VectorXd& change,
             const Eigen::VectorXd& fitted,
             LeaveOneOutScore* score) const;

  bool is_factorized_ = false;
  LeaveOneOutOptions options_;
  Eigen::VectorXd g_;
  std::vector<int> first_rows_;  // of each sample, and m
  std::vector<int> chosen_;
  bool is_parameter_side_ = false;  // J^T J in place of J J^T
  // The Gram matrix is unit_ Q T Q^T; zero if J = 0.
  double unit_ = 0.0;
  Eigen::MatrixXd K_;  // the reflectors
  Tridiagonalization reduction_;
  double lambda_max_ = 0.0;      // of T
  double smallest_ = 0.0;        // the smallest resolved value of T
  double resolution_ = 0.0;      // relative to lambda_max_
  bool has_null_space_ = false;  // of J J^T
  Eigen::MatrixXd W_;            // Q^T e, or Q^T J^T e, of each chosen row
  Eigen::VectorXd b_;            // Q^T g, or Q^T J^T g
};

// The same for one filter.
bool LeaveOneOutChange(const JacobianOperator& J,
                       const Eigen::VectorXd& g,
                       const std::vector<int>& rows_of_samples,
                       const SpectralFilter& filter,
                       const LeaveOneOutOptions& options,
                       Eigen::VectorXd* change,
                       LeaveOneOutSummary* summary);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_LEAVE_ONE_OUT_H_
