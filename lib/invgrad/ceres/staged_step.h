// Replaces the next step of a ceres::Solve by a given step.
//
//   x_candidate = Plus(x, staged step)   in the place of Plus(x, Ceres' step)
//
// A wrapper around the manifold of each non-constant parameter block replaces
// the step in the next Plus. Ceres calls Plus once for each block when it forms
// its candidate.
//
// Shapes:    step: n, in the columns of the linearizer.
// Ownership: Problem::Options::manifold_ownership determines whether a
//            ceres::Problem deletes its manifolds; Ceres 2.1 does not expose
//            the option. Both settings work: unused wrappers are kept for the
//            next StagedStep of the problem. If the problem owns its manifolds,
//            its destructor deletes the wrappers. Otherwise 64 bytes for each
//            parameter block remain, and a later problem at the same address
//            reuses them.
#ifndef INVGRAD_CERES_STAGED_STEP_H_
#define INVGRAD_CERES_STAGED_STEP_H_

#include <string>
#include <vector>

#include "ceres/problem.h"
#include "invgrad/ceres/problem_linearizer.h"

namespace invgrad {

class StagedStep {
 public:
  // False, with *error, if a block has bounds or a tangent space of more than
  // max_block_size dimensions.
  static bool IsSupported(int max_block_size,
                          const ProblemLinearizer& linearizer,
                          const ceres::Problem& problem,
                          std::string* error);

  // Wraps the manifolds of the blocks; the destructor restores the manifolds.
  // The problem must outlive the object (CHECKed if it owns its manifolds), and
  // the linearizer must have read the problem before. CHECKs that the blocks
  // are not wrapped.
  StagedStep(const ProblemLinearizer& linearizer, ceres::Problem* problem);
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
  std::vector<Block> blocks_;
  bool is_wrapped_ = true;  // the Euclidean blocks
  int num_unwraps_ = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_STAGED_STEP_H_
