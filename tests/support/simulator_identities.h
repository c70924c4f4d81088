// What holds for the derivatives of any simulator.
#ifndef TESTS_SUPPORT_SIMULATOR_IDENTITIES_H_
#define TESTS_SUPPORT_SIMULATOR_IDENTITIES_H_

#include <cmath>
#include <random>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/simulator.h"

namespace invgrad {

inline Eigen::VectorXd NormalVector(Eigen::Index size, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  return Eigen::VectorXd::NullaryExpr(size,
                                      [&]() { return normal(generator); });
}

// w . (J v) = v . (J^T w), relative to |w| |J v|; Linearize, Evaluate and
// Adjoint agree.
inline void ExpectAdjointIdentity(const Simulator& simulator,
                                  const Eigen::VectorXd& x,
                                  const double* context,
                                  double tolerance = 1e-12) {
  Eigen::VectorXd value(simulator.num_outputs());
  Eigen::VectorXd y(simulator.num_outputs());
  Eigen::VectorXd x_bar(simulator.num_inputs());
  ASSERT_TRUE(simulator.Evaluate(x.data(), context, value.data(), nullptr));
  const auto J = simulator.Linearize(x.data(), context, y.data());
  ASSERT_NE(J, nullptr);
  EXPECT_EQ(value, y);
  ASSERT_EQ(J->rows(), simulator.num_outputs());
  ASSERT_EQ(J->cols(), simulator.num_inputs());
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const Eigen::VectorXd v = NormalVector(J->cols(), seed);
    const Eigen::VectorXd w = NormalVector(J->rows(), 100 + seed);
    Eigen::VectorXd Jv, Jtw;
    J->Times(v, &Jv);
    J->TransposeTimes(w, &Jtw);
    EXPECT_NEAR(w.dot(Jv), v.dot(Jtw), tolerance * w.norm() * Jv.norm());
    const auto covector = [&w](const double* /*y*/, double* out) {
      Eigen::Map<Eigen::VectorXd>(out, w.size()) = w;
      return true;
    };
    ASSERT_TRUE(
        simulator.Adjoint(x.data(), context, covector, y.data(), x_bar.data()));
    EXPECT_EQ(value, y);
    EXPECT_LE((x_bar - Jtw).norm(), tolerance * Jtw.norm());
  }
}

// J v = (P(x + h v) - P(x - h v)) / (2 h) + O(h^2), relative to |J v|. x must
// not be closer than h |v| to a point where P is not smooth.
inline void ExpectTangentIsDifference(const Simulator& simulator,
                                      const Eigen::VectorXd& x,
                                      const double* context,
                                      double h,
                                      double tolerance) {
  Eigen::VectorXd y(simulator.num_outputs());
  const auto J = simulator.Linearize(x.data(), context, y.data());
  ASSERT_NE(J, nullptr);
  const Eigen::VectorXd v = NormalVector(J->cols(), 7);
  Eigen::VectorXd Jv;
  J->Times(v, &Jv);
  Eigen::VectorXd plus(y.size()), minus(y.size());
  const Eigen::VectorXd above = x + h * v, below = x - h * v;
  ASSERT_TRUE(simulator.Evaluate(above.data(), context, plus.data(), nullptr));
  ASSERT_TRUE(simulator.Evaluate(below.data(), context, minus.data(), nullptr));
  EXPECT_LE((Jv - (plus - minus) / (2.0 * h)).norm(), tolerance * Jv.norm());
}

}  // namespace invgrad

#endif  // TESTS_SUPPORT_SIMULATOR_IDENTITIES_H_
