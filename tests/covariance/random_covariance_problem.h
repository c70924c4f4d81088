// Random problems for the covariance: blocks of sizes 1 to 5, some constant,
// some with manifolds, some unused; linear residuals of low rank or of
// differences of two blocks; some with robust losses.
#ifndef INVGRAD_TESTS_COVARIANCE_RANDOM_COVARIANCE_PROBLEM_H_
#define INVGRAD_TESTS_COVARIANCE_RANDOM_COVARIANCE_PROBLEM_H_

#include <vector>

#include "Eigen/Core"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/sphere_manifold.h"
#include "invgrad/random.h"
#include "tests/rank/rank_problems.h"

namespace invgrad {

class RandomCovarianceProblem {
 public:
  explicit RandomCovarianceProblem(std::uint32_t seed) : random_(seed) {
    const int num_blocks = 1 + Below(6);
    for (int b = 0; b < num_blocks; ++b) AddBlock();
    const int num_residuals = 1 + Below(3 * num_blocks);
    for (int r = 0; r < num_residuals; ++r) AddResidual();
  }

  const ceres::Problem& problem() const { return problem_; }
  ceres::Problem* mutable_problem() { return &problem_; }
  std::vector<const double*> blocks() const {
    std::vector<const double*> result;
    for (const Eigen::VectorXd& block : blocks_) result.push_back(block.data());
    return result;
  }

 private:
  int Below(int limit) {
    return static_cast<int>(random_.Uniform(0.0, 1.0) * limit);
  }

  void AddBlock() {
    const int size = 1 + Below(5);
    blocks_.push_back(random_.Normal(size));
    double* x = blocks_.back().data();
    ceres::Manifold* manifold = nullptr;
    const int kind = Below(8);
    if (kind == 0 && size > 1) {
      manifold = new ceres::SubsetManifold(size, {Below(size)});
    } else if (kind <= 2 && size == 4) {
      blocks_.back().normalize();
      manifold = new ceres::QuaternionManifold;
    } else if (kind == 3 && size > 1) {
      manifold = new ceres::SphereManifold<ceres::DYNAMIC>(size);
    }
    problem_.AddParameterBlock(x, size, manifold);
    if (Below(6) == 0) problem_.SetParameterBlockConstant(x);
  }

  // Small integers: singular values are zero or far from it.
  Eigen::MatrixXd Entries(int rows, int cols) {
    return Eigen::MatrixXd::NullaryExpr(
        rows, cols, [this] { return static_cast<double>(Below(7) - 3); });
  }

  void AddResidual() {
    ceres::LossFunction* loss =
        Below(4) == 0 ? new ceres::HuberLoss(0.5) : nullptr;
    const int a = Below(static_cast<int>(blocks_.size()));
    const int b = Below(static_cast<int>(blocks_.size()));
    const int rows = 1 + Below(3);
    const auto size = [this](int block) {
      return static_cast<int>(blocks_[block].size());
    };
    Eigen::MatrixXd A = Entries(rows, size(a));
    if (a == b) {
      problem_.AddResidualBlock(new Linear({A}), loss, blocks_[a].data());
      return;
    }
    Eigen::MatrixXd B = Entries(rows, size(b));
    if (size(a) == size(b) && Below(2) == 0) B = -A;
    problem_.AddResidualBlock(
        new Linear({A, B}), loss, blocks_[a].data(), blocks_[b].data());
  }

  NumpyRandom random_;
  std::vector<Eigen::VectorXd> blocks_;
  ceres::Problem problem_;
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_COVARIANCE_RANDOM_COVARIANCE_PROBLEM_H_
