// Replaces the next step of a ceres::Solve by another one.
//
//   x_candidate = Plus(x, staged step)   in the place of Plus(x, Ceres' step)
//
// The manifold of each parameter block that is not constant is wrapped. The
// wrapper replaces the step in the next Plus, which Ceres calls once for each
// block when it forms its candidate.
//
// Shapes:    step: n, in the columns of the linearizer.
// Ownership: a ceres::Problem deletes its manifolds or does not, depending on
//            Problem::Options::manifold_ownership, which Ceres 2.1 does not
//            reveal. Both work: wrappers that a problem no longer uses are kept
//            for its next StagedStep. A problem that owns its manifolds deletes
//            them in its destructor. One that does not leaves 64 bytes for each
//            parameter block, which a later problem at the same address uses.
#ifndef INVGRAD_CERES_STAGED_STEP_H_
#define INVGRAD_CERES_STAGED_STEP_H_

#include <vector>

#include "ceres/problem.h"
#include "invgrad/ceres/problem_linearizer.h"

namespace invgrad {

class StagedStep {
 public:
  // Wraps the blocks; the destructor restores what they had. The problem must
  // outlive the object (CHECKed if it owns its manifolds), and the linearizer
  // must have read the problem before. CHECKs that the blocks are not wrapped.
  StagedStep(const ProblemLinearizer& linearizer, ceres::Problem* problem);
  ~StagedStep();
  StagedStep(const StagedStep&) = delete;
  StagedStep& operator=(const StagedStep&) = delete;

  // `step` must live until it is used or cleared.
  void Stage(const double* step);
  void Clear();

  // Whether no block has been moved since Stage. (Ceres never moves blocks that
  // no residual block uses, and a Plus that fails ends a move.)
  bool IsStaged() const;

  // Unwraps the Euclidean blocks until the next Stage, so that Ceres multiplies
  // by no identity matrix. They must be wrapped when the solve begins, because
  // Ceres allocates an evaluation's memory there.
  void Unwrap() { SetWrapped(false); }

 private:
  struct Block;

  void SetWrapped(bool wrapped);

  ceres::Problem* problem_;
  std::vector<Block> blocks_;
  bool is_wrapped_ = true;  // the Euclidean blocks
  int num_unwraps_ = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_STAGED_STEP_H_
