// Which gauge freedoms the residuals of a component are blind to.
//
//   A = J D^-1,  G = D v(x),  Q orthonormal with span(Q) = span(G):
//   the directions Q c with |A Q c| <= limit |c|
//
// A gauge counts with all generators that A does not see, and with what
// combinations of them it does not see: a camera that is held constant leaves
// the scale about its centre, which is a scale and a translation.
//
// Shapes:  A: m x n;  D: n;  motions in tangent directions, scaled: n x g.
// Cost:    O((m + n) g^2) a gauge.
#ifndef INVGRAD_RANK_GAUGE_MATCH_H_
#define INVGRAD_RANK_GAUGE_MATCH_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "invgrad/rank/gauge.h"

namespace invgrad {

struct GaugeMatch {
  std::string name;        // empty: none
  int num_generators = 0;  // that move anything
  // n x g, columns of length one, independent: what A does not see.
  Eigen::MatrixXd directions;
  // One a direction; empty for combinations of generators.
  std::vector<std::string> generators;
};

class GaugeMatcher {
 public:
  // scale: D, 0 for columns that A does not have; column_of: n entries of D
  // follow the blocks that are not constant in the component's order, and
  // column_of[i] is the column of A, or -1.
  GaugeMatcher(const GaugeComponent& component,
               const Eigen::SparseMatrix<double>& A,
               const Eigen::VectorXd& scale,
               const std::vector<int>& column_of,
               const std::vector<Gauge>& gauges);

  // The gauge with the most directions that A does not see, and among these the
  // first. Stops at `num_directions` of them.
  GaugeMatch Best(double limit, int num_directions) const;

  // The first gauge whose motions span the columns of V (length one) but for
  // 5 %; empty if none does.
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
