// Replaces the next step of a ceres::Solve by another one.
//
//   x_candidate = Plus(x, staged step)   in the place of Plus(x, Ceres' step)
//
// The manifold of each parameter block that is not constant is wrapped in a
// StagingManifold. A ceres::Problem calls Plus of all blocks once when it forms
// its candidate.
//
// Shapes:  step: n, in the columns of the linearizer.
#ifndef INVGRAD_CERES_STAGED_STEP_H_
#define INVGRAD_CERES_STAGED_STEP_H_

#include <vector>

#include "ceres/local_parameterization.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/ceres/staging_manifold.h"

namespace invgrad {

class StagedStep {
 public:
  // Wraps the blocks; the destructor restores what they had. The problem must
  // outlive the object, and the linearizer must have read the problem before.
  // CHECKs that the blocks are not wrapped yet.
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
  // A block, and what it had before it was wrapped.
  struct Block {
    double* values;
    int column;
    const ceres::Manifold* manifold;  // null: Euclidean
    const ceres::LocalParameterization* parameterization;
    StagingManifold* staging;
  };

  void SetWrapped(bool wrapped);

  ceres::Problem* problem_;
  std::vector<Block> blocks_;
  std::vector<StagingManifold*> manifolds_;
  bool is_wrapped_ = true;  // the Euclidean blocks
  int num_unwraps_ = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_STAGED_STEP_H_
