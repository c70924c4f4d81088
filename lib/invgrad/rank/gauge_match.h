// Finds the gauge freedoms that leave the residuals of a group unchanged.
//
//   A = J D^-1,  G = D v(x),  Q orthonormal with span(Q) = span(G):
//   the directions Q c with |A Q c| <= limit |c|
//
// This includes combinations of a gauge's g generators, as the scale about a
// constant camera: a k-dimensional space of motions, which the gauge may name.
// O((m + n) g^2) a gauge.
#ifndef INVGRAD_RANK_GAUGE_MATCH_H_
#define INVGRAD_RANK_GAUGE_MATCH_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "ceres/problem.h"
#include "invgrad/rank/block_groups.h"
#include "invgrad/rank_report.h"

namespace invgrad {

struct GaugeMatch {
  std::string name;        // empty: none
  int num_generators = 0;  // with a nonzero motion
  // n x g, independent columns of length one: the motions that leave the
  // residuals unchanged.
  Eigen::MatrixXd directions;
  // One a direction: a generator, a combination that the gauge names, or empty.
  std::vector<std::string> generators;
  int num_named = 0;  // of the directions, which they begin with
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
  // several, the one with most names; of several, the first. The search ends at
  // `num_wanted` named directions. A gauge explains nothing if it has no more of
  // them than any span of its dimension has in common with a null space of
  // dimension `num_null`.
  GaugeMatch Best(double limit,
                  Eigen::Index num_null,
                  Eigen::Index num_wanted) const;

  // Orthonormal: the motions of one gauge that leave the residuals unchanged, of
  // the gauge with the most of them. Without names, it costs a small part of
  // Best.
  Eigen::MatrixXd LargestUnseenSpan(double limit) const;

  // The first gauge whose motions span the columns of V (length one) up to 5 %;
  // empty if there is none.
  std::string NameOf(const Eigen::MatrixXd& V) const;

 private:
  struct Candidate {
    Gauge gauge;
    Eigen::VectorXd lengths;  // of the generators' motions
    Eigen::MatrixXd motions;  // n x g, columns of length one, or of zeros
    // Orthonormal, of the same span; empty until Basis computes it.
    mutable Eigen::MatrixXd basis;
  };
  static const Eigen::MatrixXd& Basis(const Candidate& candidate);

  struct NamedMotion {
    std::string name;
    Eigen::VectorXd motion;  // n, of length one
  };

  // Together, the columns of `unseen`, which leave the residuals unchanged, and
  // of `seen` are an orthonormal basis of the candidate's span.
  GaugeMatch Match(const Candidate& candidate,
                   const Eigen::MatrixXd& unseen,
                   const Eigen::MatrixXd& seen,
                   double limit) const;

  // Motions that leave the residuals unchanged and have names, among the
  // combinations with coefficients in the span of C's columns.
  std::vector<NamedMotion> Named(const Candidate& candidate,
                                 const Eigen::MatrixXd& C,
                                 double limit) const;

  const Eigen::SparseMatrix<double>& A_;
  const GaugeComponent component_;
  std::vector<Candidate> candidates_;
};

}  // namespace invgrad

#endif  // INVGRAD_RANK_GAUGE_MATCH_H_
