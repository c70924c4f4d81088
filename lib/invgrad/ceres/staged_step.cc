#include "invgrad/ceres/staged_step.h"

#include <algorithm>

#include "glog/logging.h"

namespace invgrad {

// Ceres 2.1 still has local parameterizations, and user code may set them.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"

StagedStep::StagedStep(const ProblemLinearizer& linearizer,
                       ceres::Problem* problem)
    : problem_(problem) {
  const std::vector<double*>& values = linearizer.parameter_blocks();
  // All at once: Ceres visits all manifolds in each evaluation, and should find
  // them side by side in memory.
  manifolds_ = StagingManifold::Take(*problem, values.size());
  blocks_.reserve(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const int block = static_cast<int>(i);
    const ceres::Manifold* const own = linearizer.manifold(block);
    CHECK(dynamic_cast<const StagingManifold*>(own) == nullptr)
        << "Another UpdateCallback of this problem still exists.";
    blocks_.push_back(
        {values[i],
         linearizer.column(block),
         own,
         own == nullptr ? nullptr : problem->GetParameterization(values[i]),
         manifolds_[i]});
    manifolds_[i]->Init(linearizer.ambient_size(block), own);
  }
  for (const Block& block : blocks_) {
    problem->SetManifold(block.values, block.staging);
  }
}

StagedStep::~StagedStep() {
  for (const Block& block : blocks_) {
    // The setters take pointers that the getters return as pointers to const.
    if (block.parameterization != nullptr) {
      problem_->SetParameterization(
          block.values,
          const_cast<ceres::LocalParameterization*>(block.parameterization));
    } else if (block.manifold != nullptr || is_wrapped_) {
      problem_->SetManifold(block.values,
                            const_cast<ceres::Manifold*>(block.manifold));
    }
  }
  StagingManifold::GiveBack(manifolds_);
}

#pragma GCC diagnostic pop

void StagedStep::Stage(const double* step) {
  SetWrapped(true);
  for (const Block& block : blocks_) block.staging->Stage(step + block.column);
}

void StagedStep::Clear() {
  for (StagingManifold* manifold : manifolds_) manifold->Clear();
}

bool StagedStep::IsStaged() const {
  return !manifolds_.empty() &&
         std::all_of(
             manifolds_.begin(), manifolds_.end(), [](const auto* manifold) {
               return manifold->is_staged();
             });
}

void StagedStep::SetWrapped(bool wrapped) {
  // A problem that owns its manifolds stores a pointer at each SetManifold.
  constexpr int kMaxNumUnwraps = 32;
  if (is_wrapped_ == wrapped) return;
  if (!wrapped && ++num_unwraps_ > kMaxNumUnwraps) return;
  is_wrapped_ = wrapped;
  for (const Block& block : blocks_) {
    if (block.manifold != nullptr) continue;
    problem_->SetManifold(block.values, wrapped ? block.staging : nullptr);
  }
}

}  // namespace invgrad
