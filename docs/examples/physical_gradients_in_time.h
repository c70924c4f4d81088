// Simulations that step through time, with known answers: the other
// measurements of physical_gradients.cc.
//
// Source:  PBDL, chapter physgrad, arXiv 2109.05237; Lorenz. Deterministic
//          nonperiodic flow. J. Atmos. Sci. 20, 1963.
#ifndef PHYSICAL_GRADIENTS_IN_TIME_H_
#define PHYSICAL_GRADIENTS_IN_TIME_H_

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Cholesky"
#include "Eigen/Core"
#include "Eigen/LU"
#include "Eigen/SVD"
#include "invgrad/random.h"
#include "invgrad/time_stepping_simulator.h"
#include "physical_gradients.h"

namespace physical_gradients {

using Eigen::Vector3d;

// One step of the classical method of order 4 for s' = derivative(s).
template <int kSize, typename T, typename Derivative>
void RungeKutta4(const Derivative& derivative, double dt, const T* s, T* next) {
  T k[4][kSize], stage[kSize];
  derivative(s, k[0]);
  for (int j = 1; j < 4; ++j) {
    const double time = j < 3 ? 0.5 * dt : dt;
    for (int i = 0; i < kSize; ++i) stage[i] = s[i] + time * k[j - 1][i];
    derivative(stage, k[j]);
  }
  for (int i = 0; i < kSize; ++i) {
    next[i] =
        s[i] + (dt / 6.0) * (k[0][i] + 2.0 * (k[1][i] + k[2][i]) + k[3][i]);
  }
}

// --- 3. A pendulum with a normalized state ---

// q'' = -sin q, or -q: a step of all states (q, q'), one a column.
inline MatrixXd PendulumStep(const MatrixXd& states, bool is_linear) {
  MatrixXd next(states.rows(), states.cols());
  const auto derivative = [is_linear](const double* s, double* ds) {
    ds[0] = s[1];
    ds[1] = is_linear ? -s[0] : -std::sin(s[0]);
  };
  for (Eigen::Index i = 0; i < states.cols(); ++i) {
    RungeKutta4<2>(derivative, 0.5, states.col(i).data(), next.col(i).data());
  }
  return next;
}

// Mean 0 and deviation 1 over the batch, in each component: a linear map with
// an inverse.
inline MatrixXd Normalized(const MatrixXd& states) {
  const MatrixXd centered = states.colwise() - states.rowwise().mean();
  const VectorXd deviation = centered.array().square().rowwise().mean().sqrt();
  return deviation.cwiseInverse().asDiagonal() * centered;
}

struct NormalizationErrors {
  double as_it_is;
  double after_map;  // the best linear map, with a constant, to the truth
};

// Of the states after num_steps, relative to their deviation; normalized after
// the last step or, with is_between, after all the others.
inline NormalizationErrors ErrorsByNormalization(bool is_linear,
                                                 bool is_between,
                                                 int num_steps) {
  constexpr int kNumStates = 200;
  MatrixXd truth = invgrad::NumpyRandom(0).Rand(2, kNumStates);
  truth = 5.0 * truth.array() - 2.5;
  MatrixXd seen = truth;
  for (int i = 0; i < num_steps; ++i) {
    truth = PendulumStep(truth, is_linear);
    seen = PendulumStep(seen, is_linear);
    if (is_between == (i + 1 < num_steps)) seen = Normalized(seen);
  }
  MatrixXd columns(kNumStates, 3);
  columns << seen.transpose(), VectorXd::Ones(kNumStates);
  const MatrixXd wanted = truth.transpose();
  const MatrixXd gram = columns.transpose() * columns;
  const MatrixXd map = gram.llt().solve(columns.transpose() * wanted);
  const double deviation = (truth.colwise() - truth.rowwise().mean()).norm();
  return {(seen - truth).norm() / deviation,
          (columns * map - wanted).norm() / deviation};
}

// --- 4. Forces at the time steps of two oscillators ---

// The chain of problems/oscillator_chain.h, with friction.
struct Oscillators {
  double dt = 0.5;
  double linear = 0.2;
  double cubic = 0.0;
  double control = 1.0;
  double friction = 0.0;

  template <typename T>
  bool operator()(const T* s, const T* u, T* next) const {
    const auto derivative = [&](const T* at, T* ds) {
      const T gap = at[1] - at[0];
      const T force = linear * gap + cubic * (gap * gap * gap);
      ds[0] = at[2];
      ds[1] = at[3];
      ds[2] = force - at[0] - friction * at[2];
      ds[3] = control * u[0] - force - at[1] - friction * at[3];
    };
    RungeKutta4<4>(derivative, dt, s, next);
    return true;
  }
};

// dy/dx, 4 x num_steps, at zero forces.
inline MatrixXd JacobianOf(const Oscillators& oscillators,
                           int num_steps,
                           const VectorXd& state) {
  const invgrad::TimeSteppingSimulator<Oscillators, 5> simulator(
      oscillators, 4, 1, num_steps);
  const VectorXd x = VectorXd::Zero(num_steps);
  VectorXd y(4);
  Eigen::Matrix<double, 4, Eigen::Dynamic, Eigen::RowMajor> J(4, num_steps);
  CHECK(simulator.Evaluate(x.data(), state.data(), y.data(), J.data()));
  return J;
}

// The root mean square of a rule's step at each time step, over all directions
// of g of length 1: the rows of V S^-kappa, J = U S V^T. With kappa = -1, of
// gradient descent, the norms of J's columns.
inline VectorXd StepByTime(const MatrixXd& J, double kappa) {
  const Eigen::JacobiSVD<MatrixXd> svd(J, Eigen::ComputeThinV);
  const VectorXd factor = svd.singularValues().array().pow(-kappa);
  return (svd.matrixV() * factor.asDiagonal()).rowwise().norm();
}

inline double Ratio(const VectorXd& values) {
  return values.maxCoeff() / values.minCoeff();
}

// --- 8. A chaotic simulation ---

// x = s(0), y = s(num_steps dt); backwards in time with dt < 0.
struct Lorenz {
  static constexpr double kTimeStep = 0.01;
  static constexpr double kExponent = 0.906;  // the largest of Lyapunov's

  int num_steps = 1;
  double dt = kTimeStep;

  // The steps that are nearest to so many Lyapunov times, 1 / 0.906.
  static int NumSteps(double lyapunov_times) {
    return static_cast<int>(
        std::lround(lyapunov_times / (kExponent * kTimeStep)));
  }

  template <typename T>
  bool operator()(const T* x, T* y) const {
    const auto derivative = [](const T* s, T* ds) {
      ds[0] = 10.0 * (s[1] - s[0]);
      ds[1] = s[0] * (28.0 - s[2]) - s[1];
      ds[2] = s[0] * s[1] - (8.0 / 3.0) * s[2];
    };
    T s[3] = {x[0], x[1], x[2]};
    for (int i = 0; i < num_steps; ++i) {
      RungeKutta4<3>(derivative, dt, s, y);
      std::copy(y, y + 3, s);
    }
    return true;
  }

  Vector3d operator()(const Vector3d& x) const {
    Vector3d y;
    (*this)(x.data(), y.data());
    return y;
  }
};

using LorenzSimulator = invgrad::AutoDiffSimulator<Lorenz, 3, 3>;

// States on the attractor, five time units apart.
inline std::vector<Vector3d> LorenzStates(int count) {
  std::vector<Vector3d> states;
  Vector3d state = Lorenz{2000}(Vector3d(1.0, 1.0, 20.0));
  for (int i = 0; i < count; ++i) {
    states.push_back(state);
    state = Lorenz{500}(state);
  }
  return states;
}

// NaN where the simulation overflows.
inline Eigen::Matrix3d LorenzJacobian(const Vector3d& x, const Lorenz& lorenz) {
  Vector3d y;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> J;
  if (!LorenzSimulator(lorenz).Evaluate(
          x.data(), nullptr, y.data(), J.data())) {
    J.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  return J;
}

// The inverse simulator: the equations backwards in time or, with is_exact,
// each step solved by Newton's method for its start.
inline Vector3d LorenzBackwards(const Vector3d& y,
                                int num_steps,
                                bool is_exact) {
  if (!is_exact) return Lorenz{num_steps, -Lorenz::kTimeStep}(y);
  Vector3d x = y;
  for (int i = 0; i < num_steps && x.allFinite(); ++i) {
    const Vector3d after = x;
    x = Lorenz{1, -Lorenz::kTimeStep}(after);
    for (int k = 0; k < 4; ++k) {
      x -= LorenzJacobian(x, Lorenz{1}).inverse() * (Lorenz{1}(x)-after);
    }
  }
  return x;
}

// |P(x) - P(x*)| for the x that the inverse simulator finds for P(x*).
inline double LorenzMiss(const Vector3d& solution,
                         int num_steps,
                         bool is_exact) {
  const Lorenz lorenz{num_steps};
  const Vector3d y = lorenz(solution);
  return (lorenz(LorenzBackwards(y, num_steps, is_exact)) - y).norm();
}

// The same for the x that a method finds from 0.1 beside x*.
inline double LorenzMiss(const Vector3d& solution,
                         int num_steps,
                         const std::string& method,
                         int max_num_iterations) {
  const Lorenz lorenz{num_steps};
  const PointSetting setting = {
      std::make_shared<LorenzSimulator>(lorenz), nullptr, lorenz(solution)};
  const Vector3d x = Path(setting,
                          solution + Vector3d(0.06, 0.0, -0.08),
                          method,
                          max_num_iterations)
                         .back();
  return (lorenz(x) - setting.target).norm();
}

}  // namespace physical_gradients

#endif  // PHYSICAL_GRADIENTS_IN_TIME_H_
