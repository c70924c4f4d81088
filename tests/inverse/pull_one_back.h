// Pulls one sample back through a curved simulator, for tests.
#ifndef TESTS_PULL_ONE_BACK_H_
#define TESTS_PULL_ONE_BACK_H_

#include <cmath>
#include <memory>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/inverse/simulator_pull_back.h"
#include "invgrad/inverse_simulator.h"
#include "tests/support/make_simulator.h"

namespace invgrad {

// y = (exp x0, x1 + x0^2), for x0 < 5 only; x = (log y0, y1 - log^2 y0).
struct Bend {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::exp;
    if (!(x[0] < T(5.0))) return false;
    y[0] = exp(x[0]);
    y[1] = x[1] + x[0] * x[0];
    return true;
  }
};

inline Eigen::Vector2d BendInverse(const InverseSimulator::ConstVectorRef& y) {
  const double x0 = std::log(y[0]);
  return {x0, y[1] - x0 * x0};
}

// Always right.
inline std::shared_ptr<const InverseSimulator> ExactBendInverse() {
  return Inverse([](const auto& y, const auto& /*x_now*/) {
    return Eigen::VectorXd(BendInverse(y));
  });
}

inline SimulatorPullBack::Options Way(SimulatorWay way,
                                      double truncation = 1e-5) {
  SimulatorPullBack::Options options;
  options.way = way;
  options.truncation = truncation;
  return options;
}

struct Pulled {
  Eigen::VectorXd y;
  Eigen::VectorXd d_x;
  SimulatorPullBack::Result result;
};

// Pulls d_y back; fails the test if that is not possible.
inline Pulled Pull(const SimulatorPullBack& pull_back,
                   const Eigen::VectorXd& x,
                   const Eigen::VectorXd& d_y) {
  Pulled pulled;
  pulled.y = Eigen::VectorXd::Constant(d_y.size(), std::nan(""));
  pulled.d_x = Eigen::VectorXd::Constant(x.size(), std::nan(""));
  pulled.result.why = "untouched";
  const Simulator::Covector wanted_change = [&](const double* y,
                                                double* change) {
    EXPECT_TRUE(AllFinite(y, d_y.size()));
    Eigen::Map<Eigen::VectorXd>(change, d_y.size()) = d_y;
    return true;
  };
  EXPECT_TRUE(pull_back(x,
                        Eigen::VectorXd(),
                        wanted_change,
                        pulled.y.data(),
                        pulled.d_x,
                        &pulled.result));
  Eigen::VectorXd y(d_y.size());
  EXPECT_TRUE(
      pull_back.simulator().Evaluate(x.data(), nullptr, y.data(), nullptr));
  EXPECT_EQ(pulled.y, y);
  return pulled;
}

}  // namespace invgrad

#endif  // TESTS_PULL_ONE_BACK_H_
