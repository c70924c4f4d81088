#include "invgrad/ceres/staged_step.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "fmt/core.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

// Wraps a block's own manifold, or the Euclidean one; its next Plus uses the
// staged step.
class StagedStep::StagingManifold final : public ceres::Manifold {
 public:
  // Does not own `own`.
  explicit StagingManifold(const ceres::Manifold* own) : own_(own) {}
  ~StagingManifold() override {
    CHECK(own_ == nullptr)
        << "A ceres::Problem was destroyed before its UpdateCallback.";
  }

  // The block has its own manifold again.
  void Release() { own_ = nullptr; }

  void Stage(const double* step) {
    staged_ = step;
    is_state_ = false;
  }
  void StageState(const double* state) {
    staged_ = state;
    is_state_ = true;
  }
  bool is_staged() const { return staged_ != nullptr; }
  void Record(double* step) { recorded_ = step; }

  int AmbientSize() const override { return own_->AmbientSize(); }
  int TangentSize() const override { return own_->TangentSize(); }

  bool Plus(const double* x,
            const double* delta,
            double* x_plus_delta) const override {
    // Written only between an iteration's callbacks and its candidate, for
    // which Ceres calls Plus once. Inner iterations call Plus from several
    // threads.
    if (recorded_ != nullptr) {
      std::copy_n(delta, TangentSize(), recorded_);
      recorded_ = nullptr;
    }
    if (staged_ != nullptr) {
      delta = staged_;
      staged_ = nullptr;
      if (is_state_) {
        std::copy_n(delta, AmbientSize(), x_plus_delta);
        return true;
      }
    }
    return own_->Plus(x, delta, x_plus_delta);
  }
  bool PlusJacobian(const double* x, double* jacobian) const override {
    return own_->PlusJacobian(x, jacobian);
  }
  bool RightMultiplyByPlusJacobian(const double* x,
                                   const int num_rows,
                                   const double* ambient_matrix,
                                   double* tangent_matrix) const override {
    return own_->RightMultiplyByPlusJacobian(
        x, num_rows, ambient_matrix, tangent_matrix);
  }
  bool Minus(const double* y,
             const double* x,
             double* y_minus_x) const override {
    return own_->Minus(y, x, y_minus_x);
  }
  bool MinusJacobian(const double* x, double* jacobian) const override {
    return own_->MinusJacobian(x, jacobian);
  }

 private:
  const ceres::Manifold* own_;
  mutable const double* staged_ = nullptr;
  bool is_state_ = false;  // staged_ is the block's next value, not a step
  mutable double* recorded_ = nullptr;
};

bool StagedStep::IsSupported(int max_block_size,
                             const ProblemStructure& structure,
                             std::string* error) {
  int i = 0;
  for (const auto& block : structure.parameter_blocks) {
    if (block.tangent_size > max_block_size) {
      *error = fmt::format(
          "parameter block {} (of those that are not constant) has size {}, "
          "which is larger than max_block_size = {}; split it into smaller "
          "blocks, or use Minimize",
          i,
          block.tangent_size,
          max_block_size);
      return false;
    }
    ++i;
  }
  return true;
}

// A block and its manifold before wrapping.
struct StagedStep::Block {
  double* values;
  int column;
  int offset;                       // in the state
  const ceres::Manifold* manifold;  // null: Euclidean
  StagingManifold* staging;
};

StagedStep::StagedStep(const ProblemStructure& structure,
                       ceres::Ownership manifold_ownership,
                       ceres::Problem* problem)
    : problem_(problem) {
  for (const auto& block : structure.parameter_blocks) {
    CHECK(dynamic_cast<const StagingManifold*>(block.manifold) == nullptr)
        << "Another UpdateCallback of this problem still exists.";
    const int size = block.ambient_size;
    auto staging = std::make_unique<StagingManifold>(
        block.manifold != nullptr
            ? block.manifold
            : &euclidean_.try_emplace(size, size).first->second);
    blocks_.push_back({block.values,
                       block.column,
                       block.offset,
                       block.manifold,
                       staging.get()});
    problem->SetManifold(block.values, staging.get());
    if (manifold_ownership == ceres::TAKE_OWNERSHIP) {
      static_cast<void>(staging.release());  // the problem deletes it
    } else {
      owned_.push_back(std::move(staging));
    }
  }
}

StagedStep::~StagedStep() {
  for (const Block& block : blocks_) {
    if (problem_->GetManifold(block.values) == block.staging) {
      // GetManifold returns a pointer to const; SetManifold takes one to
      // non-const.
      problem_->SetManifold(block.values,
                            const_cast<ceres::Manifold*>(block.manifold));
    }
    block.staging->Release();
  }
}

void StagedStep::Stage(const double* step) {
  SetWrapped(true);
  for (const Block& block : blocks_) block.staging->Stage(step + block.column);
}

void StagedStep::StageState(const double* state) {
  SetWrapped(true);
  for (const Block& block : blocks_) {
    block.staging->StageState(state + block.offset);
  }
}

void StagedStep::Clear() {
  for (const Block& block : blocks_) block.staging->Stage(nullptr);
}

void StagedStep::Record(double* step) {
  SetWrapped(true);
  for (const Block& block : blocks_) block.staging->Record(step + block.column);
}

bool StagedStep::IsStaged() const {
  return !blocks_.empty() &&
         std::all_of(blocks_.begin(), blocks_.end(), [](const Block& block) {
           return block.staging->is_staged();
         });
}

void StagedStep::Wrap() {
  for (const Block& block : blocks_) {
    const bool is_wrapped = block.manifold != nullptr || is_wrapped_;
    CHECK(problem_->GetManifold(block.values) ==
              (is_wrapped ? block.staging : nullptr) &&
          !problem_->IsParameterBlockConstant(block.values))
        << "A manifold was set, or a parameter block was held constant, since "
           "the problem has an UpdateCallback. End the callback before, and "
           "make a new one for the next solve.";
  }
  SetWrapped(true);
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
