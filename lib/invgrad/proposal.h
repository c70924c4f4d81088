// Proposals of your own inside ceres::Solve: functions that lead from the state
// of all parameter blocks to another state. Use one if you know where a better
// state may lie: by a closed-form inverse of a part of the problem, a second
// start, or scale-invariant physics training. For the steps of a rule give the
// rule itself to UpdateCallback (update_callback.h).
//
//   UpdateCallback callback(
//       [&](const ProblemState& x, ProblemState* candidate) {
//         const double* pose = x(pose_block);
//         return MyInverse(pose, (*candidate)(joint_block));
//       },
//       &problem);
//
// *candidate begins as x; what is not written stays. The candidate is carried
// into the tangent space, step = Minus(candidate, x), so that it respects the
// manifolds; it is projected onto the bounds as Ceres projects its own. It is a
// proposal only if it lowers the cost, and Ceres decides by its gain ratio.
//
// Fails:   a candidate that is not finite, or more than 1e-6 off its manifold,
//          is not proposed, and Summary::message names the block. A pointer that
//          is no parameter block, or a constant one to write, is CHECKed. What
//          the function writes into the parameter blocks themselves is undone.
#ifndef INVGRAD_PROPOSAL_H_
#define INVGRAD_PROPOSAL_H_

#include <functional>
#include <memory>
#include <string>
#include <unordered_map>
#include <utility>

#include "Eigen/Core"

namespace invgrad {

struct DataSet;
class InverseSimulator;
class Model;

// The values of a problem's parameter blocks at one state. A block is named by
// the pointer with which it was added to the problem.
class ProblemState {
 public:
  // Where a block begins in the values of all blocks; -1: it is constant.
  using Offsets = std::unordered_map<const double*, int>;

  ProblemState(std::shared_ptr<const Offsets> offsets, Eigen::VectorXd values)
      : offsets_(std::move(offsets)), values_(std::move(values)) {}

  // To read; of a constant block the block itself.
  const double* operator()(const double* block) const;
  // To write.
  double* operator()(const double* block);

  bool is_constant(const double* block) const;

  // Of all blocks that are not constant, one after the other.
  const Eigen::VectorXd& values() const { return values_; }

 private:
  std::shared_ptr<const Offsets> offsets_;
  Eigen::VectorXd values_;
};

// Returns false if there is no candidate. It must not throw.
using ProposalFunction =
    std::function<bool(const ProblemState& x, ProblemState* candidate)>;

// Scale-invariant physics training as a proposal, for a problem whose parameter
// blocks are a network's weights (AddModelToProblem, ModelCost in cost.h):
//
//   y = P(f(a; theta)),   y~ = y + Newton's step on the loss
//   x~ = P^-1(y~; x)      by the inverse simulator
//   candidate: theta after a few steps on 1/2 sum_s |f(a_s; theta) - x~_s|^2
//
// `weights` (n): the blocks of WeightBlocks, one after the other. `inverse`: of
// the model's simulator; null: the numerical inverse. `method`: any pull-back
// LOSS/SIMULATOR/RULE of docs/methods.md. "sip" takes three damped Gauss-Newton
// steps towards x~:
// newton/inverse/levenberg_marquardt:step_size=auto:control=gain:updates=3.
// Without a network (PointObjective::model) x is the parameter block.
//
// Cost:    a pull-back of each sample, and `updates` steps of the rule.
// Fails:   returns an empty function, with *error, if the method is invalid or
//          cannot train the model. A numerical failure is no candidate.
// Source:  Holl, Koltun, Thuerey. Scale-invariant Learning by Physics
//          Inversion. NeurIPS 2022, algorithm 1. arXiv 2109.15048.
ProposalFunction ScaleInvariantProposal(
    const Model& model,
    const DataSet& data,
    const double* weights,
    std::shared_ptr<const InverseSimulator> inverse,
    const std::string& method,
    std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_PROPOSAL_H_
