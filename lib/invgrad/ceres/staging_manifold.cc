#include "invgrad/ceres/staging_manifold.h"

#include <algorithm>
#include <cstring>
#include <functional>
#include <mutex>
#include <unordered_map>

#include "glog/logging.h"

namespace invgrad {
namespace {

// The address of the problem's implementation. Unlike that of the Problem it
// does not change when the problem is moved.
const void* IdentityOf(const ceres::Problem& problem) {
  static_assert(sizeof(ceres::Problem) == sizeof(void*),
                "A ceres::Problem is one pointer to its implementation.");
  const void* identity = nullptr;
  std::memcpy(&identity, &problem, sizeof(identity));
  return identity;
}

// The manifolds that are not in use, by their problem.
struct Kept {
  std::mutex mutex;
  std::unordered_map<const void*, std::vector<StagingManifold*>> manifolds;
};

// Never destroyed, because a static problem may be destroyed later.
Kept& KeptManifolds() {
  static Kept& kept = *new Kept;
  return kept;
}

}  // namespace

std::vector<StagingManifold*> StagingManifold::Take(
    const ceres::Problem& problem, std::size_t num) {
  const void* identity = IdentityOf(problem);
  std::vector<StagingManifold*> manifolds;
  manifolds.reserve(num);
  {
    Kept& kept = KeptManifolds();
    const std::lock_guard<std::mutex> lock(kept.mutex);
    const auto it = kept.manifolds.find(identity);
    if (it != kept.manifolds.end()) {
      manifolds.swap(it->second);
      if (manifolds.size() > num) {
        it->second.assign(manifolds.begin() + num, manifolds.end());
        manifolds.resize(num);
      }
    }
  }
  for (StagingManifold* manifold : manifolds) manifold->is_in_use_ = true;
  while (manifolds.size() < num) {
    manifolds.push_back(new StagingManifold(identity));
  }
  return manifolds;
}

void StagingManifold::GiveBack(const std::vector<StagingManifold*>& manifolds) {
  if (manifolds.empty()) return;
  Kept& kept = KeptManifolds();
  const std::lock_guard<std::mutex> lock(kept.mutex);
  std::vector<StagingManifold*>& of_problem =
      kept.manifolds[manifolds.front()->problem_];
  for (StagingManifold* manifold : manifolds) {
    manifold->is_in_use_ = false;
    manifold->Clear();
    of_problem.push_back(manifold);
  }
}

// Only a problem that owns its manifolds deletes one, and then it is deleting
// all of them.
StagingManifold::~StagingManifold() {
  CHECK(!is_in_use_)
      << "A ceres::Problem was destroyed before its UpdateCallback.";
  Kept& kept = KeptManifolds();
  const std::lock_guard<std::mutex> lock(kept.mutex);
  kept.manifolds.erase(problem_);
}

void StagingManifold::Init(int ambient_size, const ceres::Manifold* own) {
  ambient_size_ = ambient_size;
  tangent_size_ = own != nullptr ? own->TangentSize() : ambient_size;
  own_ = own;
  staged_ = nullptr;
}

bool StagingManifold::Plus(const double* x,
                           const double* delta,
                           double* x_plus_delta) const {
  // Written only if something is staged: then Ceres forms its candidate, and
  // calls Plus once. Inner iterations call Plus from several threads.
  if (staged_ != nullptr) {
    delta = staged_;
    staged_ = nullptr;
  }
  if (own_ != nullptr) return own_->Plus(x, delta, x_plus_delta);
  std::transform(
      x, x + ambient_size_, delta, x_plus_delta, std::plus<double>());
  return true;
}

bool StagingManifold::PlusJacobian(const double* x, double* jacobian) const {
  if (own_ != nullptr) return own_->PlusJacobian(x, jacobian);
  SetIdentity(jacobian);
  return true;
}

bool StagingManifold::RightMultiplyByPlusJacobian(
    const double* x,
    const int num_rows,
    const double* ambient_matrix,
    double* tangent_matrix) const {
  if (own_ != nullptr) {
    return own_->RightMultiplyByPlusJacobian(
        x, num_rows, ambient_matrix, tangent_matrix);
  }
  std::copy_n(ambient_matrix, num_rows * ambient_size_, tangent_matrix);
  return true;
}

bool StagingManifold::Minus(const double* y,
                            const double* x,
                            double* y_minus_x) const {
  if (own_ != nullptr) return own_->Minus(y, x, y_minus_x);
  std::transform(y, y + ambient_size_, x, y_minus_x, std::minus<double>());
  return true;
}

bool StagingManifold::MinusJacobian(const double* x, double* jacobian) const {
  if (own_ != nullptr) return own_->MinusJacobian(x, jacobian);
  SetIdentity(jacobian);
  return true;
}

void StagingManifold::SetIdentity(double* matrix) const {
  std::fill_n(matrix, ambient_size_ * ambient_size_, 0.0);
  for (int i = 0; i < ambient_size_; ++i) matrix[i * ambient_size_ + i] = 1.0;
}

}  // namespace invgrad
