// Problems of blocks, manifolds and losses of many kinds, for tests.
#ifndef INVGRAD_TESTS_CERES_MIXED_PROBLEM_H_
#define INVGRAD_TESTS_CERES_MIXED_PROBLEM_H_

#include "ceres/cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/product_manifold.h"
#include "invgrad/second_order_cost_function.h"

namespace invgrad {

// r_i = scale (sin(i + sum_k (k + 1) a_k) + i b_0 b_last), curved in a and in
// b.
template <int kA, int kB>
struct Mix {
  explicit Mix(double scale) : scale(scale) {}
  template <typename T>
  bool operator()(const T* a, const T* b, T* r) const {
    T sum(0.0);
    for (int k = 0; k < kA; ++k) sum += (k + 1.0) * a[k];
    for (int i = 0; i < 3; ++i) {
      r[i] = scale * (sin(sum + double(i)) + double(i) * b[0] * b[kB - 1]);
    }
    return true;
  }
  double scale;
};

template <int kA, int kB>
ceres::CostFunction* NewMix(double scale) {
  return new AutoDiffSecondOrderCostFunction<Mix<kA, kB>, 3, kA, kB>(
      new Mix<kA, kB>(scale));
}

// Several blocks, of several kinds. The order in which residual blocks name
// them is not the order of the columns.
struct Blocks {
  double x[2] = {0.3, -0.8};
  double q[4] = {0.8, 0.4, -0.4, 0.2};  // unit length
  double e[4] = {0.5, -0.5, 0.5, 0.5};
  double s[3] = {1.1, -0.2, 0.6};
  double pose[7] = {0.1, 0.7, 0.7, 0.1, 2.0, -1.0, 0.5};
  double constant[2] = {0.9, 0.2};
  double frozen[3] = {0.3, 0.4, 0.5};
  double unused[3] = {7.0, 8.0, 9.0};

  void AddTo(ceres::Problem* problem) {
    problem->AddParameterBlock(x, 2);
    problem->AddParameterBlock(unused, 3);
    problem->AddParameterBlock(constant, 2);
    problem->AddParameterBlock(q, 4, new ceres::QuaternionManifold);
    problem->AddParameterBlock(e, 4, new ceres::EigenQuaternionManifold);
    problem->AddParameterBlock(s, 3, new ceres::SubsetManifold(3, {1}));
    problem->AddParameterBlock(
        pose,
        7,
        new ceres::ProductManifold<ceres::QuaternionManifold,
                                   ceres::EuclideanManifold<3>>);
    // Constant by a tangent space of size 0.
    problem->AddParameterBlock(
        frozen, 3, new ceres::SubsetManifold(3, {0, 1, 2}));
    problem->SetParameterBlockConstant(constant);
  }
};

// Residuals of size `scale`: losses of scale 1 see inliers and outliers.
inline void AddResiduals(double scale, Blocks* b, ceres::Problem* problem) {
  problem->AddResidualBlock(NewMix<2, 4>(scale), nullptr, b->x, b->q);
  problem->AddResidualBlock(
      NewMix<4, 2>(scale), new ceres::HuberLoss(1.0), b->e, b->x);
  problem->AddResidualBlock(
      NewMix<7, 3>(scale), new ceres::CauchyLoss(1.0), b->pose, b->s);
  problem->AddResidualBlock(
      NewMix<2, 3>(scale), new ceres::TukeyLoss(1.0), b->constant, b->s);
  problem->AddResidualBlock(
      NewMix<2, 3>(scale),
      new ceres::ScaledLoss(
          new ceres::HuberLoss(0.5), 3.0, ceres::TAKE_OWNERSHIP),
      b->x,
      b->frozen);
  problem->AddResidualBlock(
      NewMix<4, 7>(scale),
      new ceres::ScaledLoss(nullptr, 0.3, ceres::TAKE_OWNERSHIP),
      b->q,
      b->pose);
  // rho'' > 0: the second-order correction.
  problem->AddResidualBlock(
      NewMix<3, 2>(scale), new ceres::TolerantLoss(1.0, 0.5), b->s, b->x);
  // Nothing here can change.
  problem->AddResidualBlock(NewMix<2, 3>(scale),
                            new ceres::SoftLOneLoss(1.0),
                            b->constant,
                            b->frozen);
}

// d/dx sqrt(x) at 0: the residual is finite, the Jacobian is not.
struct Root {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = sqrt(x[0]);
    return true;
  }
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_CERES_MIXED_PROBLEM_H_
