#include "invgrad/ceres/staged_step.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <mutex>
#include <unordered_map>

#include "ceres/manifold.h"
#include "fmt/core.h"
#include "invgrad/internal/logging.h"

// Ceres 2.1 still has local parameterizations, and user code may set them.
#if __has_include("ceres/local_parameterization.h")
#define INVGRAD_LOCAL_PARAMETERIZATIONS
#include "ceres/local_parameterization.h"
#endif

namespace invgrad {

// Wraps a block's own manifold, or the Euclidean one; its next Plus uses the
// staged step.
class StagingManifold final : public ceres::Manifold {
 public:
  // Returns `num` manifolds for `problem`; call Init on each. Call GiveBack
  // when the blocks of the problem no longer use them; the next Take reuses
  // them.
  static std::vector<StagingManifold*> Take(const ceres::Problem& problem,
                                            std::size_t num);
  static void GiveBack(StagingManifold* manifold);

  ~StagingManifold() override;

  // `own` is not owned.
  void Init(const ceres::Manifold* own) {
    own_ = own;
    staged_ = nullptr;
  }

  void Stage(const double* step) {
    staged_ = step;
    is_state_ = false;
  }
  void StageState(const double* state) {
    staged_ = state;
    is_state_ = true;
  }
  bool is_staged() const { return staged_ != nullptr; }

  int AmbientSize() const override { return own_->AmbientSize(); }
  int TangentSize() const override { return own_->TangentSize(); }

  bool Plus(const double* x,
            const double* delta,
            double* x_plus_delta) const override {
    // Written only if a step is staged: Ceres then forms its candidate and
    // calls Plus once. Inner iterations call Plus from several threads.
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
  explicit StagingManifold(const void* problem) : problem_(problem) {}

  const ceres::Manifold* own_ = nullptr;
  mutable const double* staged_ = nullptr;
  bool is_state_ = false;      // staged_ is the block's next value, not a step
  const void* const problem_;  // its identity
  bool is_in_use_ = true;      // between Take and GiveBack
};

namespace {

// The address of the implementation of the problem, which does not change when
// the Problem is moved.
const void* IdentityOf(const ceres::Problem& problem) {
  static_assert(sizeof(ceres::Problem) == sizeof(void*),
                "A ceres::Problem is one pointer to its implementation.");
  const void* identity = nullptr;
  std::memcpy(&identity, static_cast<const void*>(&problem), sizeof(identity));
  return identity;
}

// The unused manifolds of each problem.
struct KeptManifolds {
  std::mutex mutex;
  std::unordered_map<const void*, std::vector<StagingManifold*>> by_problem;
};

// Never destroyed, because a static problem may be destroyed later.
KeptManifolds& Kept() {
  static KeptManifolds& kept = *new KeptManifolds;
  return kept;
}

}  // namespace

std::vector<StagingManifold*> StagingManifold::Take(
    const ceres::Problem& problem, std::size_t num) {
  const void* const identity = IdentityOf(problem);
  const std::lock_guard<std::mutex> lock(Kept().mutex);
  std::vector<StagingManifold*>& kept = Kept().by_problem[identity];
  std::vector<StagingManifold*> manifolds;
  while (manifolds.size() < num) {
    if (kept.empty()) kept.push_back(new StagingManifold(identity));
    manifolds.push_back(kept.back());
    manifolds.back()->is_in_use_ = true;
    kept.pop_back();
  }
  return manifolds;
}

void StagingManifold::GiveBack(StagingManifold* manifold) {
  const std::lock_guard<std::mutex> lock(Kept().mutex);
  manifold->is_in_use_ = false;
  Kept().by_problem[manifold->problem_].push_back(manifold);
}

// Only a problem that owns its manifolds deletes one, and then it deletes all.
StagingManifold::~StagingManifold() {
  CHECK(!is_in_use_)
      << "A ceres::Problem was destroyed before its UpdateCallback.";
  const std::lock_guard<std::mutex> lock(Kept().mutex);
  Kept().by_problem.erase(problem_);
}

namespace {

bool IsBounded(const ceres::Problem& problem, const double* values, int size) {
  // "If the parameter is not bounded by the user" (ceres/problem.h).
  constexpr double kUnbounded = std::numeric_limits<double>::max();
  for (int i = 0; i < size; ++i) {
    if (problem.GetParameterLowerBound(values, i) > -kUnbounded ||
        problem.GetParameterUpperBound(values, i) < kUnbounded) {
      return true;
    }
  }
  return false;
}

}  // namespace

bool StagedStep::IsSupported(int max_block_size,
                             const ProblemStructure& structure,
                             const ceres::Problem& problem,
                             std::string* error) {
  int i = 0;
  for (const auto& block : structure.parameter_blocks) {
    const std::string name =
        fmt::format("parameter block {} (of those that are not constant)", i++);
    if (block.tangent_size > max_block_size) {
      *error = fmt::format(
          "{} has size {}, which is larger than max_block_size = {}; split it "
          "into smaller blocks, or use Minimize",
          name,
          block.tangent_size,
          max_block_size);
      return false;
    }
    if (IsBounded(problem, block.values, block.ambient_size)) {
      *error = name +
               " has bounds, which UpdateCallback does not support; replace "
               "them by a change of variables, or solve without "
               "UpdateCallback";
      return false;
    }
  }
  return true;
}

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"

// A block and its manifold before wrapping.
struct StagedStep::Block {
  double* values;
  int column;
  int offset;                       // in the state
  const ceres::Manifold* manifold;  // null: Euclidean
  StagingManifold* staging;
#ifdef INVGRAD_LOCAL_PARAMETERIZATIONS
  const ceres::LocalParameterization* parameterization = nullptr;
#endif
};

StagedStep::StagedStep(const ProblemStructure& structure,
                       ceres::Problem* problem)
    : problem_(problem) {
  const std::vector<StagingManifold*> manifolds =
      StagingManifold::Take(*problem, structure.parameter_blocks.size());
  blocks_.reserve(manifolds.size());
  for (std::size_t i = 0; i < manifolds.size(); ++i) {
    const ProblemStructure::ParameterBlock& block =
        structure.parameter_blocks[i];
    CHECK(dynamic_cast<const StagingManifold*>(block.manifold) == nullptr)
        << "Another UpdateCallback of this problem still exists.";
    blocks_.push_back({block.values,
                       block.column,
                       block.offset,
                       block.manifold,
                       manifolds[i]});
#ifdef INVGRAD_LOCAL_PARAMETERIZATIONS
    blocks_.back().parameterization =
        block.manifold == nullptr ? nullptr
                                  : problem->GetParameterization(block.values);
#endif
    const int size = block.ambient_size;
    manifolds[i]->Init(block.manifold != nullptr
                           ? block.manifold
                           : &euclidean_.try_emplace(size, size).first->second);
  }
  for (const Block& block : blocks_) {
    problem->SetManifold(block.values, block.staging);
  }
}

StagedStep::~StagedStep() {
  // In reverse order, so that Take returns them in the order of their
  // construction.
  for (auto block = blocks_.rbegin(); block != blocks_.rend(); ++block) {
    // The getters return pointers to const; the setters take pointers to
    // non-const.
#ifdef INVGRAD_LOCAL_PARAMETERIZATIONS
    if (block->parameterization != nullptr) {
      problem_->SetParameterization(
          block->values,
          const_cast<ceres::LocalParameterization*>(block->parameterization));
    } else
#endif
        if (block->manifold != nullptr || is_wrapped_) {
      problem_->SetManifold(block->values,
                            const_cast<ceres::Manifold*>(block->manifold));
    }
    StagingManifold::GiveBack(block->staging);
  }
}

#pragma GCC diagnostic pop

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

bool StagedStep::IsStaged() const {
  return !blocks_.empty() &&
         std::all_of(blocks_.begin(), blocks_.end(), [](const Block& block) {
           return block.staging->is_staged();
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
