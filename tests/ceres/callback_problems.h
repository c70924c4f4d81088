// A rule and problems for tests of UpdateCallback.
#ifndef INVGRAD_TESTS_CERES_CALLBACK_PROBLEMS_H_
#define INVGRAD_TESTS_CERES_CALLBACK_PROBLEMS_H_

#include <cmath>
#include <string>

#include "Eigen/Core"
#include "Eigen/SVD"
#include "ceres/autodiff_cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/rotation.h"
#include "ceres/solver.h"
#include "ceres/types.h"
#include "invgrad/update_callback.h"
#include "invgrad/update_rule.h"

namespace invgrad {

// step = -eta V S^(-kappa) U^T r, s > 1e-10 s_max, with the eta that minimizes
// the linear model.
class PowerRule final : public UpdateRule {
 public:
  explicit PowerRule(double kappa) : kappa_(kappa) {}
  LinearizationParts Needs() const override {
    return LinearizationParts::Jacobian();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string*) override {
    ++num_calls;
    Eigen::MatrixXd J;
    at_x.jacobian->ToDense(&J);
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(
        J, Eigen::ComputeThinU | Eigen::ComputeThinV);
    Eigen::VectorXd c = svd.matrixU().transpose() * at_x.loss_gradient;
    const Eigen::VectorXd& s = svd.singularValues();
    for (int i = 0; i < c.size(); ++i) {
      c[i] = s[i] > 1e-10 * s[0] ? c[i] * std::pow(s[i], -kappa_) : 0.0;
    }
    const Eigen::VectorXd d = -(svd.matrixV() * c);
    const Eigen::VectorXd Jd = J * d;
    *step = -at_x.loss_gradient.dot(Jd) / Jd.squaredNorm() * d;
    return true;
  }
  int num_calls = 0;

 private:
  double kappa_;
};

inline ceres::Solver::Options SolverOptions(UpdateCallback* callback) {
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 500;
  if (callback != nullptr) callback->AddTo(&options);
  return options;
}

struct Offset {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] - 10.0;
    return true;
  }
};

// Two poses that see each other's points: quaternions with a manifold, plain
// blocks, a constant block, robust losses with outliers, and a residual block
// that nothing can change.
struct Sighting {
  template <typename T>
  bool operator()(const T* q, const T* t, const T* p, T* r) const {
    ceres::QuaternionRotatePoint(q, p, r);
    for (int i = 0; i < 3; ++i) r[i] += t[i] - measured[i];
    return true;
  }
  double measured[3];
};

struct Anchor {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    for (int i = 0; i < 3; ++i) r[i] = x[i] - 2.0;
    return true;
  }
};

struct PoseProblem {
  double q[4] = {0.9, 0.1, -0.3, 0.3};
  double t[3] = {0.0, 0.0, 0.0};
  double points[4][3] = {
      {1.0, 0.0, 0.5}, {0.0, 2.0, -1.0}, {-1.0, 0.5, 0.3}, {0.4, -0.6, 1.5}};
  ceres::Problem problem;

  static constexpr double kTruth[4] = {0.5, -0.5, 0.1, 0.7};
  static constexpr double kShift[3] = {0.3, -1.0, 2.0};

  explicit PoseProblem(
      const ceres::Problem::Options& options = ceres::Problem::Options(),
      ceres::Manifold* manifold = new ceres::QuaternionManifold)
      : problem(options) {
    problem.AddParameterBlock(q, 4, manifold);
    for (int k = 0; k < 4; ++k) {
      auto* sighting = new Sighting;
      ceres::QuaternionRotatePoint(kTruth, points[k], sighting->measured);
      for (int i = 0; i < 3; ++i) sighting->measured[i] += kShift[i];
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Sighting, 3, 4, 3, 3>(sighting),
          new ceres::HuberLoss(0.5),
          q,
          t,
          points[k]);
      problem.SetParameterBlockConstant(points[k]);
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Anchor, 3, 3>(new Anchor),
          new ceres::CauchyLoss(1.0),
          points[k]);
    }
    double length = 0.0;
    for (const double v : q) length += v * v;
    for (double& v : q) v /= std::sqrt(length);
  }
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_CERES_CALLBACK_PROBLEMS_H_
