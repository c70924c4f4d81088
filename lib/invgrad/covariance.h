// Computes the covariance of the estimated parameters of a ceres::Problem:
// standard deviations and correlations. Use it in place of ceres::Covariance
// where the residuals may leave some parameters undetermined. To find out which
// parameters these are, use rank_report.h.
//
//   C = (J^T J)^+        the pseudo-inverse, in tangent directions
//   C_ambient = P C P^T  P: the PlusJacobian of the manifold
//
//   Covariance covariance;
//   std::string error;
//   if (!ComputeCovariance({}, problem, MarginalPairs(problem), &covariance,
//                          &error)) {
//     LOG(ERROR) << error;
//   }
//   std::cout << covariance.ToText();
//
// J is the Jacobian of ProblemLinearizer at the current values, for residuals
// of variance one, corrected for robust losses; its rank is that of the rank
// report (rank_report.h), which does not depend on the parameters' units. If J
// has full rank, C is the inverse.
//
// Undetermined directions. V_0 is an orthonormal basis of the null space of
// A = J D^-1, D = diag(|J e_i|), such as gauge freedoms. The undetermined share
// of parameter i is |V_0^T e_i|^2, which does not depend on units either:
//   0  the data determine the parameter; C_ii is its variance
//   1  the data say nothing about it; its standard deviation is infinite
//   otherwise C_ii is the variance of the estimate of least norm, which
//      depends on the units of the parameters that the direction mixes. For a
//      gauge freedom it is the gauge-free covariance [1], and a function that
//      the gauge leaves unchanged has the variance that any gauge gives.
//
// Bounds. A component at its bound counts as constant: its rows of C are zero,
// and C is the covariance of the others for this value. That is so, too, for a
// direction of a manifold that moves the component alone.
//
// Shapes:  a block (a, b) has the tangent sizes of a and b.
// Units:   of the parameters. With use_residual_variance, C is multiplied by
//          2 L / (m - rank), the estimated variance of a residual.
// Cost:    one linearization, and for each group of coupled blocks one SVD or
//          one sparse decomposition (pseudo_inverse.h), as rank.max_dense_size
//          says. A group of the second kind never has an n x n matrix, and the
//          accuracy of a decomposition of A^T A.
// Fails:   ComputeCovariance returns false, with a message, as
//          ComputeRankReport and SparsePseudoInverse do. CHECKs that the
//          problem has the blocks, and that a block that is read was computed.
//
// Compared with Ceres: ceres::Covariance fails for rank-deficient problems with
// SPARSE_QR, and takes an n x n matrix with DENSE_SVD.
//
// [1] Kanatani, Morris. Gauges and gauge transformations for uncertainty
//     description of geometric structure with indeterminacy. IEEE Trans. Inf.
//     Theory 47 (2001).
#ifndef INVGRAD_COVARIANCE_H_
#define INVGRAD_COVARIANCE_H_

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "ceres/problem.h"
#include "invgrad/rank_report.h"

namespace invgrad {

class Covariance {
 public:
  struct Options {
    Options() { rank.max_dense_size = 300; }
    RankReport::Options rank;
    bool use_residual_variance = false;
  };

  using Pair = std::pair<const double*, const double*>;

  // A block that is not constant, and what is known of its parameters: one
  // entry a tangent direction. Only blocks whose own pair (b, b) was computed
  // have standard deviations.
  struct Block {
    RankReport::Block block;
    Eigen::VectorXd values;  // ambient
    Eigen::VectorXd undetermined_shares;
    Eigen::VectorXd standard_deviations;
    // How much the threshold of the rank matters. NaN, which is not known, in
    // groups that are not dense (rank.max_dense_size).
    // The part of the variance that comes from directions with
    // threshold < s / s_max <= weak_threshold (rank_report.h).
    Eigen::VectorXd weak_variances;
    // What directions with s / s_max <= threshold would add to the variance of a
    // determined parameter, if they counted as determined.
    Eigen::VectorXd omitted_variances;
    Eigen::MatrixXd plus_jacobian;  // P; empty: the identity
    // The directions whose derivatives count as 0, if some of these are
    // rounding errors (rank_report.h). The rest of C is that for constants in
    // their place.
    std::vector<int> rounding;
    // The directions of components at their bounds, which count as constant.
    std::vector<int> at_bound;
  };

  // (a, b) may be read as (b, a). Zero for a constant block.
  Eigen::MatrixXd TangentBlock(const double* a, const double* b) const;
  Eigen::MatrixXd AmbientBlock(const double* a, const double* b) const;
  // C_ij / sqrt(C_ii C_jj), in tangent directions; NaN where a standard
  // deviation is zero or infinite, and for a constant block. Needs (a, a) and
  // (b, b), too.
  Eigen::MatrixXd Correlations(const double* a, const double* b) const;

  const std::vector<Block>& blocks() const { return blocks_; }
  // The computed blocks (i, j), i <= j, of blocks().
  const std::map<std::pair<int, int>, Eigen::MatrixXd>& tangent_blocks() const {
    return computed_;
  }
  // CHECKs that the block is not constant.
  const Block& block(const double* values) const;

  double cost() const { return cost_; }  // L
  int num_residuals() const { return num_residuals_; }
  // Tangent, without those at their bounds.
  int num_parameters() const { return num_parameters_; }
  int rank() const { return rank_; }
  // 2 L / (m - rank); NaN if m <= rank.
  double residual_variance() const;
  bool uses_residual_variance() const { return uses_residual_variance_; }

  // Values, standard deviations, what is not determined, and the computed
  // correlations of at least min_correlation. Lists end after max_items.
  std::string ToText(double min_correlation = 0.1, int max_items = 20) const;

 private:
  class Computation;
  friend bool ComputeCovariance(const Options& options,
                                const ceres::Problem& problem,
                                const std::vector<Pair>& pairs,
                                Covariance* covariance,
                                std::string* error);

  std::vector<Block> blocks_;
  std::map<const double*, int> index_;                       // in blocks_
  std::map<const double*, Eigen::Vector2i> constant_sizes_;  // tangent, ambient
  std::map<std::pair<int, int>, Eigen::MatrixXd> computed_;
  double cost_ = 0.0;
  int num_residuals_ = 0;
  int num_parameters_ = 0;
  int rank_ = 0;
  bool uses_residual_variance_ = false;
};

bool ComputeCovariance(const Covariance::Options& options,
                       const ceres::Problem& problem,
                       const std::vector<Covariance::Pair>& pairs,
                       Covariance* covariance,
                       std::string* error);

// (b, b) for all blocks that are not constant.
std::vector<Covariance::Pair> MarginalPairs(const ceres::Problem& problem);

// All pairs of the blocks.
std::vector<Covariance::Pair> AllPairs(
    const std::vector<const double*>& blocks);

// The rows of blocks: each of them with every block that is not constant.
std::vector<Covariance::Pair> RowPairs(
    const ceres::Problem& problem, const std::vector<const double*>& blocks);

}  // namespace invgrad

#endif  // INVGRAD_COVARIANCE_H_
