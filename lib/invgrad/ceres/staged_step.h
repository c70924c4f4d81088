// Replaces the next step of a ceres::Solve by a given step.
//
//   x_candidate = Plus(x, staged step)   in the place of Plus(x, Ceres' step)
//
// A wrapper around the manifold of each non-constant parameter block replaces
// the step in the next Plus, which Ceres calls once for each block when it forms
// its candidate.
//
// Shapes:    step: n, in the columns of the structure.
// Ownership: a problem deletes the manifolds that it was given, and so the
//            wrappers, unless its Problem::Options::manifold_ownership is
//            DO_NOT_TAKE_OWNERSHIP; then this object deletes them. Until an
//            owning problem is destroyed, 64 bytes for each parameter block and
//            StagedStep remain.
#ifndef INVGRAD_CERES_STAGED_STEP_H_
#define INVGRAD_CERES_STAGED_STEP_H_

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/types.h"
#include "invgrad/ceres/problem_structure.h"

namespace invgrad {

class StagedStep {
 public:
  // False, with *error, if a block has a tangent space of more than
  // max_block_size dimensions.
  static bool IsSupported(int max_block_size,
                          const ProblemStructure& structure,
                          std::string* error);

  // Wraps the manifolds of the blocks; the destructor restores them, but for
  // those that the user has set since. The problem must outlive the object
  // (CHECKed if it owns its manifolds).
  // CHECKs that the blocks are not wrapped. `structure`: of all its residual
  // blocks. `manifold_ownership`: the problem's.
  StagedStep(const ProblemStructure& structure,
             ceres::Ownership manifold_ownership,
             ceres::Problem* problem);
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

  // Writes the step of the next Plus to `step` (n), which must live until then;
  // entries of blocks that do not move are not written.
  void Record(double* step);

  // Unwraps the Euclidean blocks, so that Ceres does not multiply by identity
  // matrices, until the next Stage or Wrap. The blocks must be wrapped when a
  // solve begins, because Ceres then allocates the memory for evaluations.
  // Wrap CHECKs that nobody else has set a manifold, or held a block constant.
  void Unwrap() { SetWrapped(false); }
  void Wrap();

 private:
  class StagingManifold;
  struct Block;

  void SetWrapped(bool wrapped);

  ceres::Problem* problem_;
  // Those that the problem does not own.
  std::vector<std::unique_ptr<StagingManifold>> owned_;
  std::map<int, ceres::EuclideanManifold<ceres::DYNAMIC>>
      euclidean_;  // by size
  std::vector<Block> blocks_;
  bool is_wrapped_ = true;  // the Euclidean blocks
  int num_unwraps_ = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_STAGED_STEP_H_
