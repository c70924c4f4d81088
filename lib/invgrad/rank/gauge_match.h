// Finds the gauge freedoms that leave the residuals of a group unchanged.
//
//   A = J D^-1,  G = D v(x),  Q orthonormal with span(Q) = span(G):
//   the directions Q c with |A Q c| <= limit |c|
//
// This includes combinations of a gauge's g generators, as the scale about a
// constant camera. O((m + n) g^2) a gauge.
#ifndef INVGRAD_RANK_GAUGE_MATCH_H_
#define INVGRAD_RANK_GAUGE_MATCH_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "ceres/problem.h"
#include "invgrad/rank/block_groups.h"
#include "invgrad/rank/rank_report.h"

namespace invgrad {

struct GaugeMatch {
  std::string name;        // empty: none
  int num_generators = 0;  // with a nonzero motion
  // n x g, independent columns of length one: the motions that leave the
  // residuals unchanged.
  Eigen::MatrixXd directions;
  // One a direction; empty for combinations of generators.
  std::vector<std::string> generators;
};

class GaugeMatcher {
 public:
  // The options' gauges and the built-in ones that fit the group. The group must
  // outlive the matcher.
  GaugeMatcher(const RankReport::Options& options,
               const ceres::Problem& problem,
               const RankReport& report,
               const BlockGroup& group);

  // The gauge with the most directions that leave the residuals unchanged; of
  // several, the first. The search ends at `num_directions` of them.
  GaugeMatch Best(double limit, int num_directions) const;

  // The first gauge whose motions span the columns of V (length one) up to 5 %;
  // empty if there is none.
  std::string NameOf(const Eigen::MatrixXd& V) const;

 private:
  struct Candidate {
    std::string name;
    std::vector<std::string> generators;
    Eigen::MatrixXd motions;  // n x g, columns of length one
    Eigen::MatrixXd basis;    // orthonormal, of the same span
  };

  const Eigen::SparseMatrix<double>& A_;
  std::vector<Candidate> candidates_;
};

}  // namespace invgrad

#endif  // INVGRAD_RANK_GAUGE_MATCH_H_
