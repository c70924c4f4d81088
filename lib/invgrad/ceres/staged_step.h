// Replaces the next step of a ceres::Solve by a given step.
//
//   x_candidate = Plus(x, staged step)   in the place of Plus(x, Ceres' step)
//
// A wrapper around the manifold of each non-constant parameter block replaces
// the step in the next Plus, which Ceres calls once for each block when it forms
// its candidate.
//
// Shapes:    step: n, in the columns of the structure.
// Ownership: Ceres 2.1 does not expose whether a problem owns its manifolds
//            (Problem::Options::manifold_ownership). Both settings work: unused
//            wrappers are kept for the next StagedStep of the problem, and its
//            destructor deletes them if it owns its manifolds. Otherwise 64
//            bytes for each parameter block remain, and a later problem at the
//            same address reuses them.
#ifndef INVGRAD_CERES_STAGED_STEP_H_
#define INVGRAD_CERES_STAGED_STEP_H_

#include <map>
#include <string>
#include <vector>

#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "invgrad/ceres/problem_structure.h"

namespace invgrad {

class StagedStep {
 public:
  // False, with *error, if a block has bounds or a tangent space of more than
  // max_block_size dimensions.
  static bool IsSupported(int max_block_size,
                          const ProblemStructure& structure,
                          const ceres::Problem& problem,
                          std::string* error);

  // Wraps the manifolds of the blocks; the destructor restores the manifolds.
  // The problem must outlive the object (CHECKed if it owns its manifolds).
  // CHECKs that the blocks are not wrapped. `structure`: of all its residual
  // blocks.
  StagedStep(const ProblemStructure& structure, ceres::Problem* problem);
  ~StagedStep();
  StagedStep(const StagedStep&) = delete;
  StagedStep& operator=(const StagedStep&) = delete;

  // `step` (n) must live until it is used or cleared.
  void Stage(const double* step);
  // The candidate is `state` (ProblemLinearizer::State), which must live until
  // it is used or cleared.
  void StageState(const double* state);
  void Clear();

  // Whether no block has moved since Stage. (Ceres never moves unused blocks,
  // and a failing Plus ends a move.)
  bool IsStaged() const;

  // Unwraps the Euclidean blocks until the next Stage, so that Ceres does not
  // multiply by identity matrices. The blocks must be wrapped when the solve
  // begins, because Ceres then allocates the memory for evaluations.
  void Unwrap() { SetWrapped(false); }

 private:
  struct Block;

  void SetWrapped(bool wrapped);

  ceres::Problem* problem_;
  std::map<int, ceres::EuclideanManifold<ceres::DYNAMIC>>
      euclidean_;  // by size
  std::vector<Block> blocks_;
  bool is_wrapped_ = true;  // the Euclidean blocks
  int num_unwraps_ = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_STAGED_STEP_H_
