// Variable projection: eliminates the parameters of a ceres::Problem in which
// its residuals are affine, so that ceres::Solve minimizes over the others.
//
//   L(alpha) = min_c 1/2 sum_b rho_b(|r_b(alpha, c)|^2),
//   r(alpha, c) = r_0(alpha) + Phi(alpha) c
//
//   std::string error;
//   auto separable = SeparableProblem::Create({}, {{amplitudes}}, &problem,
//                                             &error);
//   if (separable == nullptr) LOG(FATAL) << error;
//   ceres::Solve(options, separable->reduced(), &summary);
//   separable->SolveLinear(&error);                  // amplitudes = c(alpha)
//
// Residual blocks that share linear parameters c form a component, which
// becomes one residual block of the reduced problem (reduced_cost.h). The
// reduced problem has the blocks of the user's problem that are not linear,
// with their values, manifolds, bounds and constness, and the residual blocks
// without linear parameters as they are. Where the linear parameters of each
// component are a few (a point seen by affine cameras), the reduced problem is
// as sparse in the others as a Schur complement.
//
// L has the same minima as the problem, at the same cost. LM needs no start for
// c, and mostly fewer iterations (docs/results/separable_fits.md).
//
// Linear parameters that the residuals do not determine have the least norm, in
// units of the lengths of their columns of Phi (linear_projection.h), and
// rank() < num_linear(). ComputeRankReport (rank/rank_report.h) names them. A
// linear parameter that is in no residual block keeps its value.
//
// Cost:    reduced_cost.h. A component has dense matrices of its m residuals, p
//          linear parameters and the n parameters of its other blocks.
// Fails:   Create returns null, with a message, if residuals are not affine in
//          the parameters (affine_check.h; linear_parameters.h proves it), if a
//          linear parameter has bounds or a manifold, if a loss has rho < 0 or
//          rho' < 0, or if memory does not suffice. CHECKs that the problem has
//          the blocks, and that no parameter is named twice.
// Needs:   cost functions that depend only on their parameters; evaluation
//          callbacks are not called.
// Threads: as ceres::Solve.
#ifndef INVGRAD_SEPARABLE_PROBLEM_H_
#define INVGRAD_SEPARABLE_PROBLEM_H_

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "invgrad/separable/reduced_cost.h"

namespace invgrad {

// Linear parameters: a block of the problem, or some of its components.
struct LinearBlock {
  double* values;
  std::vector<int> components = {};  // empty: all
};

class SeparableProblem {
 public:
  struct Options {
    // Of Phi, relative to the largest pivot (linear_projection.h).
    double rank_threshold = kLinearRankThreshold;
    // The Jacobian of Golub and Pereyra in place of Kaufman's; not with robust
    // losses. It costs p + 1 evaluations more.
    bool is_golub_pereyra = false;
    // The name of a block; "" or no function: "block i", as in a RankReport.
    std::function<std::string(const double* values)> block_name;
  };

  // The problem must outlive the result, and keep its residual blocks; later
  // changes of blocks, manifolds, bounds and constness have no effect. Linear
  // blocks that are constant stay constant.
  static std::unique_ptr<SeparableProblem> Create(
      const Options& options,
      const std::vector<LinearBlock>& linear,
      ceres::Problem* problem,
      std::string* error);

  // Over the memory of the user's blocks.
  ceres::Problem* reduced() { return &reduced_; }

  // Sets the linear parameters of the user's blocks to c, at the current values
  // of the others. Returns false, with a message, if a cost function fails, or
  // if the residuals are not affine there.
  bool SolveLinear(std::string* error);

  int num_components() const { return static_cast<int>(costs_.size()); }
  int num_linear() const { return num_linear_; }
  // The sum of the components' ranks of Phi, after SolveLinear.
  int rank() const { return rank_; }

 private:
  class Builder;

  explicit SeparableProblem(const Options& options);
  std::string BlockName(const double* values, int index) const;
  bool CheckAllAffine(std::string* error) const;

  const Options options_;
  std::vector<std::unique_ptr<ReducedCost>> costs_;
  // Hold the linear parameters of blocks with others constant.
  std::vector<std::unique_ptr<ceres::Manifold>> manifolds_;
  double constant_ = 0.0;  // the block of a component without others
  int num_linear_ = 0;
  int rank_ = 0;
  ceres::Problem reduced_;
};

}  // namespace invgrad

#endif  // INVGRAD_SEPARABLE_PROBLEM_H_
