#include "invgrad/ceres/cached_problem.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <vector>

#include "ceres/cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/types.h"
#include "invgrad/ceres/copy_problem.h"
#include "invgrad/ceres/second_order_cost_function.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

// Calls the user's evaluation callback.
class CachedProblem::Preparation final : public ceres::EvaluationCallback {
 public:
  explicit Preparation(ceres::EvaluationCallback* own) : own_(own) {}
  void PrepareForEvaluation(bool evaluate_jacobians,
                            bool new_evaluation_point) override {
    num_points_ += new_evaluation_point;
    own_->PrepareForEvaluation(evaluate_jacobians, new_evaluation_point);
  }
  // Values that were stored before the last one are not used.
  const long& num_points() const { return num_points_; }

 private:
  ceres::EvaluationCallback* own_;  // null: none
  long num_points_ = 0;
};

namespace {

// Base is ceres::CostFunction or SecondOrderCostFunction.
template <typename Base>
class CachingCostFunction : public Base {
 public:
  // Does not own its arguments.
  CachingCostFunction(const long* num_points, const Base* own)
      : own_(*own), num_points_(*num_points) {
    this->set_num_residuals(own->num_residuals());
    *this->mutable_parameter_block_sizes() = own->parameter_block_sizes();
    const auto& sizes = own->parameter_block_sizes();
    num_parameters_ = std::accumulate(sizes.begin(), sizes.end(), 0);
  }

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    // At a candidate, a new point, Ceres evaluates no Jacobians.
    if (jacobians == nullptr) {
      return own_.Evaluate(parameters, residuals, nullptr);
    }
    const bool is_stored = IsStored(parameters, jacobians);
    if (!is_stored) {
      if (!own_.Evaluate(parameters, residuals, jacobians)) return false;
      Store(parameters, residuals, jacobians);
      return true;
    }
    const double* memory = memory_.data() + num_parameters_;
    std::copy_n(memory, this->num_residuals(), residuals);
    memory += this->num_residuals();
    for (std::size_t b = 0; b < has_jacobian_.size(); ++b) {
      const std::ptrdiff_t size = JacobianSize(b);
      if (jacobians[b] != nullptr) std::copy_n(memory, size, jacobians[b]);
      memory += size;
    }
    return true;
  }

 protected:
  const Base& own_;

 private:
  std::ptrdiff_t JacobianSize(std::size_t b) const {
    return std::ptrdiff_t{this->num_residuals()} *
           this->parameter_block_sizes()[b];
  }

  bool IsStored(double const* const* parameters, double** jacobians) const {
    if (memory_.empty() || point_ != num_points_) return false;
    const double* stored = memory_.data();
    bool any = false;
    for (std::size_t b = 0; b < has_jacobian_.size(); ++b) {
      const int size = this->parameter_block_sizes()[b];
      if (std::memcmp(parameters[b], stored, sizeof(double) * size) != 0 ||
          (jacobians[b] != nullptr && !has_jacobian_[b])) {
        return false;
      }
      any = any || jacobians[b] != nullptr;
      stored += size;
    }
    return any;
  }

  void Store(double const* const* parameters,
             const double* residuals,
             double** jacobians) const {
    point_ = num_points_;
    const std::size_t num_residuals = this->num_residuals();
    memory_.resize(num_parameters_ + num_residuals +
                   num_residuals * num_parameters_);
    has_jacobian_.resize(this->parameter_block_sizes().size());
    double* memory = memory_.data();
    for (std::size_t b = 0; b < has_jacobian_.size(); ++b) {
      memory =
          std::copy_n(parameters[b], this->parameter_block_sizes()[b], memory);
    }
    memory = std::copy_n(residuals, num_residuals, memory);
    for (std::size_t b = 0; b < has_jacobian_.size(); ++b) {
      const std::ptrdiff_t size = JacobianSize(b);
      has_jacobian_[b] = jacobians[b] != nullptr;
      if (jacobians[b] != nullptr) std::copy_n(jacobians[b], size, memory);
      memory += size;
    }
  }

  const long& num_points_;
  std::size_t num_parameters_;
  // Parameters, residuals, row-major Jacobians of all blocks; empty: none.
  mutable std::vector<double> memory_;
  mutable std::vector<char> has_jacobian_;  // of each block
  mutable long point_ = 0;                  // num_points_ when they were stored
};

class CachingSecondOrderCostFunction final
    : public CachingCostFunction<SecondOrderCostFunction> {
 public:
  using CachingCostFunction::CachingCostFunction;
  bool WeightedHessian(const double* const* parameters,
                       const double* w,
                       double* hessian) const override {
    return own_.WeightedHessian(parameters, w, hessian);
  }
};

ceres::CostFunction* MakeCaching(const long* num_points,
                                 const ceres::CostFunction* own) {
  if (const auto* second_order =
          dynamic_cast<const SecondOrderCostFunction*>(own)) {
    return new CachingSecondOrderCostFunction(num_points, second_order);
  }
  return new CachingCostFunction<ceres::CostFunction>(num_points, own);
}

}  // namespace

CachedProblem::CachedProblem(const Options& options, ceres::Problem* problem)
    : preparation_(std::make_unique<Preparation>(options.evaluation_callback)),
      copy_(CopyOptions(ceres::TAKE_OWNERSHIP,
                        options.evaluation_callback != nullptr
                            ? preparation_.get()
                            : nullptr)) {
  CHECK(problem != nullptr);
  CopyProblem(
      *problem,
      [this](const ceres::CostFunction* own) {
        return MakeCaching(&preparation_->num_points(), own);
      },
      [problem](const double* values) { return problem->GetManifold(values); },
      &copy_);
}

CachedProblem::~CachedProblem() = default;

}  // namespace invgrad
