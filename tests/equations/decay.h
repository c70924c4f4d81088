// u_t = -p u, u(0, x) = 1 + x^2: an equation that a small network solves in a
// moment.
#ifndef TESTS_EQUATIONS_DECAY_H_
#define TESTS_EQUATIONS_DECAY_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/equation.h"
#include "invgrad/trial_function.h"

namespace invgrad {

inline const Box kDecayBox = {Eigen::Vector2d(0.0, -1.0),
                              Eigen::Vector2d(1.0, 1.0)};

struct DecayResidual {
  // u: u, u_t, p.
  template <typename T>
  bool operator()(const T* u, T* y) const {
    y[0] = u[1] + u[2] * u[0];
    return true;
  }
};

inline void DecayStart(const InputJet* a, InputJet* u) {
  u[0] = 1.0 + a[1] * a[1];
}

inline double DecaySolution(double rate, const Eigen::VectorXd& point) {
  return (1.0 + point[1] * point[1]) * std::exp(-rate * point[0]);
}

// On begin <= t <= end, from the start u.
inline Equation DecayEquation(double rate,
                              double begin = 0.0,
                              double end = 1.0,
                              const InputFunction& start = DecayStart) {
  Equation decay;
  decay.trial.derivatives =
      std::make_shared<DerivativeSet>("tx", std::vector<std::string>{"t"});
  decay.trial.boundary_values = start;
  decay.trial.distance = [begin](const InputJet* a, InputJet* d) {
    d[0] = a[0] - begin;
  };
  const Box box = {Eigen::Vector2d(begin, -1.0), Eigen::Vector2d(end, 1.0)};
  decay.terms = {{"decay",
                  std::make_shared<AutoDiffSimulator<DecayResidual, 3, 1>>(),
                  GaussPoints(box, {6, 8})}};
  decay.hidden = {8};
  decay.coefficients = Eigen::VectorXd::Constant(1, rate);
  return decay;
}

}  // namespace invgrad

#endif  // TESTS_EQUATIONS_DECAY_H_
