// A time step for tests of closed loops.
#ifndef TESTS_PENDULUM_STEP_H_
#define TESTS_PENDULUM_STEP_H_

#include <cmath>

namespace invgrad {

// A pendulum with `num_controls` controls, semi-implicit Euler; refuses torques
// beyond 50.
struct PendulumStep {
  int num_controls = 1;

  template <typename T>
  bool operator()(const T* s, const T* u, T* next) const {
    using std::sin;
    T torque = u[0] * (1.0 + s[0] * s[0]);
    for (int i = 1; i < num_controls; ++i) torque += s[1] * sin(u[i]);
    next[1] = s[1] + 0.3 * (torque - sin(s[0]));
    next[0] = s[0] + 0.3 * next[1];
    return u[0] < T(50.0) && u[0] > T(-50.0);
  }
};

}  // namespace invgrad

#endif  // TESTS_PENDULUM_STEP_H_
