#include "invgrad/ceres/cached_problem.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <utility>

#include "ceres/cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/types.h"
#include "glog/logging.h"
#include "invgrad/ceres/second_order_cost_function.h"

namespace invgrad {

// The sizes of a cost function.
struct CostFunctionShape {
  explicit CostFunctionShape(const ceres::CostFunction& function)
      : num_residuals(function.num_residuals()),
        block_sizes(function.parameter_block_sizes()),
        num_parameters(
            std::accumulate(block_sizes.begin(), block_sizes.end(), 0)) {}

  std::ptrdiff_t JacobianSize(std::size_t block) const {
    return std::ptrdiff_t{num_residuals} * block_sizes[block];
  }
  // Size of the stored values, in doubles.
  std::ptrdiff_t Size() const {
    return num_parameters + num_residuals +
           std::ptrdiff_t{num_residuals} * num_parameters;
  }

  int num_residuals;
  std::vector<std::int32_t> block_sizes;
  int num_parameters;
};

namespace {

// Base is ceres::CostFunction or SecondOrderCostFunction.
template <typename Base>
class CachingCostFunction : public Base {
 public:
  // `memory` has shape->Size() doubles, `has_jacobian` one zero byte for each
  // parameter block. Does not own its arguments.
  CachingCostFunction(const Base* own,
                      const CostFunctionShape* shape,
                      double* memory,
                      char* has_jacobian)
      : own_(*own), shape_(*shape), memory_(memory), has_(has_jacobian) {
    this->set_num_residuals(own->num_residuals());
    *this->mutable_parameter_block_sizes() = own->parameter_block_sizes();
  }

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    // At a candidate, a new point, Ceres evaluates no Jacobians.
    if (jacobians == nullptr) {
      return own_.Evaluate(parameters, residuals, nullptr);
    }
    if (IsStored(parameters, jacobians)) {
      Recall(residuals, jacobians);
      return true;
    }
    if (!own_.Evaluate(parameters, residuals, jacobians)) return false;
    Store(parameters, residuals, jacobians);
    return true;
  }

 protected:
  const Base& own_;

 private:
  bool IsStored(double const* const* parameters, double** jacobians) const {
    const double* stored = memory_;
    bool any = false;
    for (std::size_t b = 0; b < shape_.block_sizes.size(); ++b) {
      const int size = shape_.block_sizes[b];
      if (std::memcmp(parameters[b], stored, sizeof(double) * size) != 0) {
        return false;
      }
      if (jacobians[b] != nullptr) {
        if (has_[b] == 0) return false;
        any = true;
      }
      stored += size;
    }
    return any;
  }

  void Recall(double* residuals, double** jacobians) const {
    const double* memory = memory_ + shape_.num_parameters;
    std::copy_n(memory, shape_.num_residuals, residuals);
    memory += shape_.num_residuals;
    for (std::size_t b = 0; b < shape_.block_sizes.size(); ++b) {
      const std::ptrdiff_t size = shape_.JacobianSize(b);
      if (jacobians[b] != nullptr) std::copy_n(memory, size, jacobians[b]);
      memory += size;
    }
  }

  void Store(double const* const* parameters,
             const double* residuals,
             double** jacobians) const {
    double* memory = memory_;
    for (std::size_t b = 0; b < shape_.block_sizes.size(); ++b) {
      memory = std::copy_n(parameters[b], shape_.block_sizes[b], memory);
    }
    memory = std::copy_n(residuals, shape_.num_residuals, memory);
    for (std::size_t b = 0; b < shape_.block_sizes.size(); ++b) {
      const std::ptrdiff_t size = shape_.JacobianSize(b);
      has_[b] = jacobians[b] != nullptr ? 1 : 0;
      if (jacobians[b] != nullptr) std::copy_n(jacobians[b], size, memory);
      memory += size;
    }
  }

  const CostFunctionShape& shape_;
  double* memory_;  // parameters, residuals, row-major Jacobians of all blocks
  char* has_;       // whether a block's Jacobian is stored
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

ceres::CostFunction* MakeCaching(const ceres::CostFunction* own,
                                 const CostFunctionShape* shape,
                                 double* memory,
                                 char* has_jacobian) {
  if (const auto* second_order =
          dynamic_cast<const SecondOrderCostFunction*>(own)) {
    return new CachingSecondOrderCostFunction(
        second_order, shape, memory, has_jacobian);
  }
  return new CachingCostFunction<ceres::CostFunction>(
      own, shape, memory, has_jacobian);
}

// The copy owns its caching cost functions, but no object of the user.
ceres::Problem::Options CopyOptions(ceres::EvaluationCallback* callback) {
  ceres::Problem::Options options;
  options.cost_function_ownership = ceres::TAKE_OWNERSHIP;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  // The user's problem is already checked.
  options.disable_all_safety_checks = true;
  options.evaluation_callback = callback;
  return options;
}

}  // namespace

CachedProblem::CachedProblem(const Options& options, ceres::Problem* problem)
    : copy_(CopyOptions(options.evaluation_callback)) {
  CHECK(problem != nullptr);
  CopyResidualBlocks(*problem);
  CopyParameterBlocks(*problem);
}

CachedProblem::~CachedProblem() = default;

const CostFunctionShape* CachedProblem::ShapeOf(
    const ceres::CostFunction& function) {
  std::vector<int> key = {function.num_residuals()};
  key.insert(key.end(),
             function.parameter_block_sizes().begin(),
             function.parameter_block_sizes().end());
  std::unique_ptr<CostFunctionShape>& shape = shapes_[std::move(key)];
  if (shape == nullptr) shape = std::make_unique<CostFunctionShape>(function);
  return shape.get();
}

void CachedProblem::CopyResidualBlocks(const ceres::Problem& problem) {
  std::vector<ceres::ResidualBlockId> ids;
  problem.GetResidualBlocks(&ids);
  std::vector<const CostFunctionShape*> shapes;
  std::size_t memory_size = 0;
  std::size_t num_arguments = 0;
  for (const ceres::ResidualBlockId id : ids) {
    shapes.push_back(ShapeOf(*problem.GetCostFunctionForResidualBlock(id)));
    memory_size += shapes.back()->Size();
    num_arguments += shapes.back()->block_sizes.size();
  }
  memory_.resize(memory_size);
  has_jacobian_.resize(num_arguments, 0);
  double* memory = memory_.data();
  char* has_jacobian = has_jacobian_.data();
  std::vector<double*> blocks;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    problem.GetParameterBlocksForResidualBlock(ids[i], &blocks);
    // The getters return pointers to const; the setters take pointers to
    // non-const.
    copy_.AddResidualBlock(
        MakeCaching(problem.GetCostFunctionForResidualBlock(ids[i]),
                    shapes[i],
                    memory,
                    has_jacobian),
        const_cast<ceres::LossFunction*>(
            problem.GetLossFunctionForResidualBlock(ids[i])),
        blocks);
    memory += shapes[i]->Size();
    has_jacobian += blocks.size();
  }
}

void CachedProblem::CopyParameterBlocks(const ceres::Problem& problem) {
  std::vector<double*> blocks;
  problem.GetParameterBlocks(&blocks);
  for (double* values : blocks) {
    const int size = problem.ParameterBlockSize(values);
    copy_.AddParameterBlock(
        values,
        size,
        const_cast<ceres::Manifold*>(problem.GetManifold(values)));
    if (problem.IsParameterBlockConstant(values)) {
      copy_.SetParameterBlockConstant(values);
    }
    for (int i = 0; i < size; ++i) {
      // These have no effect without a bound.
      copy_.SetParameterLowerBound(
          values, i, problem.GetParameterLowerBound(values, i));
      copy_.SetParameterUpperBound(
          values, i, problem.GetParameterUpperBound(values, i));
    }
  }
}

}  // namespace invgrad
