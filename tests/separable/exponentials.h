// Sums of exponentials: samples y_i of sum_j c_j exp(-a_j t_i), one residual
// block a sample, with the amplitudes c and the rates a as two blocks.
#ifndef INVGRAD_TESTS_SEPARABLE_EXPONENTIALS_H_
#define INVGRAD_TESTS_SEPARABLE_EXPONENTIALS_H_

#include <cmath>
#include <functional>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/random.h"

namespace invgrad {

template <int p>
struct ExponentialSample {
  double t;
  double y;

  template <typename T>
  bool operator()(const T* c, const T* a, T* r) const {
    using std::exp;
    r[0] = T(-y);
    for (int j = 0; j < p; ++j) r[0] += c[j] * exp(-a[j] * t);
    return true;
  }
};

// Two exponentials with noise; outliers at every fifth sample.
struct Exponentials {
  Eigen::VectorXd t;
  Eigen::VectorXd y;
  Eigen::Vector2d c = {1.0, 1.0};
  Eigen::Vector2d a = {2.0, 0.2};

  explicit Exponentials(int num_samples,
                        double noise = 0.01,
                        double outlier = 0.0)
      : t(Eigen::VectorXd::LinSpaced(num_samples, 0.0, 4.0)) {
    NumpyRandom random(1);
    y = 2.0 * (-1.5 * t.array()).exp() + 0.7 * (-0.3 * t.array()).exp();
    y += noise * random.Normal(num_samples);
    for (int i = 0; i < num_samples; i += 5) y[i] += outlier;
  }

  static ceres::CostFunction* Cost(double t, double y) {
    return new ceres::AutoDiffCostFunction<ExponentialSample<2>, 1, 2, 2>(
        new ExponentialSample<2>{t, y});
  }

  void AddTo(ceres::Problem* problem,
             const std::function<ceres::LossFunction*()>& make_loss = nullptr) {
    for (Eigen::Index i = 0; i < t.size(); ++i) {
      problem->AddResidualBlock(Cost(t[i], y[i]),
                                make_loss ? make_loss() : nullptr,
                                c.data(),
                                a.data());
    }
  }

  Eigen::MatrixXd Phi() const {
    Eigen::MatrixXd Phi(t.size(), 2);
    for (int j = 0; j < 2; ++j) Phi.col(j) = (-a[j] * t.array()).exp();
    return Phi;
  }
};

// To the last digits.
inline ceres::Solver::Options Exact() {
  ceres::Solver::Options options;
  options.max_num_iterations = 1000;
  options.function_tolerance = 1e-16;
  options.gradient_tolerance = 1e-13;
  options.parameter_tolerance = 1e-14;
  options.linear_solver_type = ceres::DENSE_QR;
  options.logging_type = ceres::SILENT;
  return options;
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SEPARABLE_EXPONENTIALS_H_
