#include "problems/schroedinger.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <random>
#include <vector>

#include "Eigen/Eigenvalues"
#include "gtest/gtest.h"
#include "invgrad/internal/nested_jet.h"

namespace invgrad {
namespace schroedinger_test {

using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr int kPoints = SchroedingerSimulator::kNumPoints;
constexpr int kSize = SchroedingerSimulator::kStateSize;
constexpr double kDx = SchroedingerSimulator::kSpacing;

VectorXd RandomVector(int size, double bound, int seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(-bound, bound);
  return VectorXd::NullaryExpr(size, [&] { return uniform(generator); });
}

VectorXd RandomState(int seed) {
  return RandomVector(kSize, 1.0, seed).normalized();
}

VectorXcd Complex(const VectorXd& state) {
  return Eigen::Map<const VectorXcd>(
      reinterpret_cast<const std::complex<double>*>(state.data()), kPoints);
}

VectorXd Evolve(const VectorXd& controls, double dt, const VectorXd& start) {
  const SchroedingerSimulator simulator(static_cast<int>(controls.size()), dt);
  VectorXd y(kSize);
  EXPECT_TRUE(
      simulator.Evaluate(controls.data(), start.data(), y.data(), nullptr));
  return y;
}

RowMajorMatrix Jacobian(const VectorXd& controls,
                        double dt,
                        const VectorXd& start) {
  const SchroedingerSimulator simulator(static_cast<int>(controls.size()), dt);
  VectorXd y(kSize);
  RowMajorMatrix J(kSize, controls.size());
  EXPECT_TRUE(
      simulator.Evaluate(controls.data(), start.data(), y.data(), J.data()));
  return J;
}

// H(u).
MatrixXd Hamiltonian(double u) {
  MatrixXd H = MatrixXd::Zero(kPoints, kPoints);
  for (int k = 0; k < kPoints; ++k) {
    H(k, k) = 2.0 / (kDx * kDx) + u * (k + 1) * kDx;
    if (k > 0) H(k, k - 1) = H(k - 1, k) = -1.0 / (kDx * kDx);
  }
  return H;
}

// (1 + i dt/2 H) psi_{t+1} = (1 - i dt/2 H) psi_t on one scalar type, for as
// many steps as there are controls: the oracle. In real numbers, re - B im and
// im + B re with B = dt/2 H, in the order of the state: elimination in a band
// of three, without pivots, as the symmetric part of the matrix is the
// identity.
template <typename T>
std::vector<T> RollOut(const std::vector<T>& controls,
                       double dt,
                       const VectorXd& start) {
  constexpr int kBand = 3;
  std::vector<T> state(start.data(), start.data() + kSize);
  const MatrixXd free = 0.5 * dt * Hamiltonian(0.0);
  std::vector<std::vector<T>> M(kSize);
  for (const T& u : controls) {
    for (int i = 0; i < kSize; ++i) {
      M[i].assign(kSize, T(0.0));
      M[i][i] = T(1.0);
    }
    std::vector<T> b = state;
    for (int i = 0; i < kPoints; ++i) {
      for (int j = std::max(i - 1, 0); j < std::min(i + 2, kPoints); ++j) {
        T B(free(i, j));
        if (i == j) B += (0.5 * dt * (i + 1) * kDx) * u;
        M[2 * i][2 * j + 1] = -B;
        M[2 * i + 1][2 * j] = B;
        b[2 * i] += B * state[2 * j + 1];
        b[2 * i + 1] -= B * state[2 * j];
      }
    }
    for (int k = 0; k < kSize; ++k) {
      const int end = std::min(k + kBand + 1, kSize);
      for (int i = k + 1; i < end; ++i) {
        const T factor = M[i][k] / M[k][k];
        for (int j = k; j < end; ++j) M[i][j] -= factor * M[k][j];
        b[i] -= factor * b[k];
      }
    }
    for (int k = kSize - 1; k >= 0; --k) {
      const int end = std::min(k + kBand + 1, kSize);
      for (int j = k + 1; j < end; ++j) b[k] -= M[k][j] * b[j];
      b[k] /= M[k][k];
    }
    state = b;
  }
  return state;
}

TEST(Schroedinger, EigenstatesAreThoseOfTheFreeHamiltonian) {
  for (int n = 1; n <= kPoints; ++n) {
    const VectorXcd state = Complex(SchroedingerSimulator::Eigenstate(n));
    const double energy =
        (2.0 - 2.0 * std::cos(n * M_PI / (kPoints + 1))) / (kDx * kDx);
    EXPECT_LT((Hamiltonian(0.0) * state - energy * state).norm(), 1e-11) << n;
    EXPECT_NEAR(state.norm(), 1.0, 1e-15);
    EXPECT_EQ(state.imag().norm(), 0.0);
  }
}

// Crank and Nicolson turn an eigenstate of energy E by
// (1 - i dt E / 2) / (1 + i dt E / 2) a step.
TEST(Schroedinger, FreeEigenstatesOnlyTurnTheirPhase) {
  const double dt = 0.05;
  const int num_steps = 384;
  for (int n = 1; n <= kPoints; ++n) {
    const VectorXd start = SchroedingerSimulator::Eigenstate(n);
    const double energy =
        (2.0 - 2.0 * std::cos(n * M_PI / (kPoints + 1))) / (kDx * kDx);
    const std::complex<double> turned =
        std::polar(1.0, -2.0 * num_steps * std::atan(0.5 * dt * energy));
    const VectorXd y = Evolve(VectorXd::Zero(num_steps), dt, start);
    EXPECT_LT((Complex(y) - turned * Complex(start)).norm(), 1e-12) << n;
  }
}

TEST(Schroedinger, StepsConserveTheNorm) {
  for (const double bound : {1.0, 100.0, 1e4}) {
    VectorXd state = RandomState(1);
    const VectorXd controls = RandomVector(100, bound, 2);
    for (const double u : controls) {
      const double norm = state.norm();
      state = Evolve(VectorXd::Constant(1, u), 0.05, state);
      EXPECT_NEAR(state.norm(), norm, 1e-12) << "u = " << u;
    }
  }
}

TEST(Schroedinger, SteppingBackReturnsToTheStart) {
  const VectorXd start = RandomState(3);
  const VectorXd controls = RandomVector(384, 5.0, 4);
  const VectorXd y = Evolve(controls, 0.05, start);
  EXPECT_GT((y - start).norm(), 0.1);
  // 768 steps of rounding errors of a few 1e-16.
  EXPECT_LT((Evolve(controls.reverse(), -0.05, y) - start).norm(), 1e-12);
}

// The exact solution for constant u is exp(-i H(u) T).
TEST(Schroedinger, IsOfOrderTwoInTime) {
  const VectorXd pulses = RandomVector(5, 3.0, 5);
  const double pulse_length = 0.1;
  const VectorXd start = (SchroedingerSimulator::Eigenstate(1) +
                          SchroedingerSimulator::Eigenstate(2))
                             .normalized();
  VectorXcd exact = Complex(start);
  for (const double u : pulses) {
    const Eigen::SelfAdjointEigenSolver<MatrixXd> H(Hamiltonian(u));
    const VectorXcd phases =
        (std::complex<double>(0.0, -pulse_length) * H.eigenvalues())
            .array()
            .exp();
    exact = H.eigenvectors() *
            (phases.asDiagonal() * (H.eigenvectors().transpose() * exact));
  }
  const auto error = [&](int steps_a_pulse) {
    VectorXd controls(pulses.size() * steps_a_pulse);
    for (int t = 0; t < controls.size(); ++t) {
      controls[t] = pulses[t / steps_a_pulse];
    }
    return (Complex(Evolve(controls, pulse_length / steps_a_pulse, start)) -
            exact)
        .norm();
  };
  // The control excites states of energies of some hundreds: the terms of order
  // dt^4 are gone once dt is well below a thousandth.
  EXPECT_NEAR(std::log2(error(128) / error(256)), 2.0, 0.01);
}

// Enough steps for two of the blocks that the Hessian is made in.
class SchroedingerDerivatives : public testing::Test {
 protected:
  static constexpr int kNumSteps = kPoints + 3;
  static constexpr double kDt = 0.05;
  // All values are of order one or less, after some thousand operations.
  static constexpr double kRounding = 1e-13;

  const VectorXd start_ = RandomState(6);
  const VectorXd controls_ = RandomVector(kNumSteps, 2.0, 7);
};

// Two controls at a time: Jets of few derivatives compile quickly.
TEST_F(SchroedingerDerivatives, AreThoseOfNestedJetsThroughTheRollOut) {
  using Jet = NestedJet<1>;
  const VectorXd w = RandomVector(kSize, 1.0, 8);
  const SchroedingerSimulator simulator(kNumSteps, kDt);
  MatrixXd H = MatrixXd::Constant(kNumSteps, kNumSteps, 9.0);
  ASSERT_TRUE(simulator.WeightedHessian(
      controls_.data(), start_.data(), w.data(), H.data()));
  const VectorXd y = Evolve(controls_, kDt, start_);
  const RowMajorMatrix J = Jacobian(controls_, kDt, start_);
  double largest = 0.0;
  for (int s = 0; s < kNumSteps; ++s) {
    for (int t = 0; t <= s; ++t) {
      std::vector<Jet> jets(controls_.begin(), controls_.end());
      jets[s].v[0] = InnerJet<1>(1.0);
      jets[t].a.v[0] = 1.0;
      const std::vector<Jet> expected = RollOut(jets, kDt, start_);
      double second = 0.0;
      for (int i = 0; i < kSize; ++i) {
        EXPECT_NEAR(y[i], expected[i].a.a, kRounding);
        EXPECT_NEAR(J(i, s), expected[i].v[0].a, kRounding);
        second += w[i] * expected[i].v[0].v[0];
      }
      EXPECT_NEAR(H(s, t), second, kRounding);
      largest = std::max(largest, std::abs(second));
    }
  }
  EXPECT_EQ(H, H.transpose());
  EXPECT_GT(largest, 1e-4);
  EXPECT_GT(J.colwise().norm().minCoeff(), 1e-3);  // no column is trivial
}

TEST_F(SchroedingerDerivatives, PullBackIsTheTransposedJacobian) {
  const SchroedingerSimulator simulator(kNumSteps, kDt);
  const VectorXd y = Evolve(controls_, kDt, start_);
  const VectorXd weights = RandomVector(kSize, 1.0, 9);
  VectorXd value(kSize), pulled(kNumSteps);
  ASSERT_TRUE(simulator.Adjoint(
      controls_.data(),
      start_.data(),
      [&](const double* at, double* w) {
        for (int i = 0; i < kSize; ++i) w[i] = weights[i] * at[i];
        return true;
      },
      value.data(),
      pulled.data()));
  EXPECT_EQ(value, y);
  const VectorXd w = weights.cwiseProduct(y);
  EXPECT_LT((pulled - Jacobian(controls_, kDt, start_).transpose() * w).norm(),
            kRounding);
  EXPECT_FALSE(simulator.Adjoint(
      controls_.data(),
      start_.data(),
      [](const double*, double*) { return false; },
      value.data(),
      pulled.data()));
}

// As steps are unitary, <y|dy/du_t> = -i dt <phi_t|X|phi_t>: its real part,
// y^T J in real numbers, is zero, and its imaginary part is the turn of the
// phase.
TEST_F(SchroedingerDerivatives, NormIsANullDirectionAndThePhaseTurns) {
  const RowMajorMatrix J = Jacobian(controls_, kDt, start_);
  const VectorXcd y = Complex(Evolve(controls_, kDt, start_));
  for (int t = 0; t < kNumSteps; ++t) {
    const VectorXcd phi =
        0.5 * (Complex(Evolve(controls_.head(t + 1), kDt, start_)) +
               (t == 0 ? Complex(start_)
                       : Complex(Evolve(controls_.head(t), kDt, start_))));
    double mean_x = 0.0;
    for (int k = 0; k < kPoints; ++k) {
      mean_x += (k + 1) * kDx * std::norm(phi[k]);
    }
    const std::complex<double> product = y.dot(Complex(J.col(t)));
    EXPECT_NEAR(product.real(), 0.0, kRounding) << t;
    EXPECT_NEAR(product.imag(), -kDt * mean_x, kRounding) << t;
  }
}

// H(u) dominated by u: psi_{t+1} -> -psi_t, also where u^2 overflows.
TEST(Schroedinger, StepsReverseTheSignUnderAHugeControl) {
  const VectorXd start = RandomState(10);
  EXPECT_LT((Evolve(VectorXd::Constant(3, 1e12), 0.05, start) + start).norm(),
            1e-6);
  EXPECT_EQ(Evolve(VectorXd::Constant(3, 1e200), 0.05, start), -start);
}

TEST(Schroedinger, ValuesThatAreNotFiniteFail) {
  const VectorXd start = RandomState(11);
  const auto covector = [&](const double*, double* w) {
    std::copy_n(start.data(), kSize, w);
    return true;
  };
  const SchroedingerSimulator simulator(3, 0.05);
  VectorXd y(kSize), pulled(3);
  RowMajorMatrix J(kSize, 3);
  MatrixXd H(3, 3);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity()}) {
    const Eigen::Vector3d u(0.0, bad, 0.0);
    EXPECT_FALSE(simulator.Evaluate(u.data(), start.data(), y.data(), nullptr));
    EXPECT_FALSE(
        simulator.Evaluate(u.data(), start.data(), y.data(), J.data()));
    EXPECT_FALSE(simulator.Adjoint(
        u.data(), start.data(), covector, y.data(), pulled.data()));
    EXPECT_FALSE(simulator.WeightedHessian(
        u.data(), start.data(), start.data(), H.data()));
  }
}

}  // namespace schroedinger_test
}  // namespace invgrad
