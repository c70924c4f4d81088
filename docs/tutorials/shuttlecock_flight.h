// The flight of a shuttlecock, with drag.
#ifndef SHUTTLECOCK_FLIGHT_H_
#define SHUTTLECOCK_FLIGHT_H_

#include <cmath>

// [functor]
// Where a shuttlecock is, one second after it was hit with velocity x [m/s].
struct Flight {
  static constexpr double kGravity = 9.81;    // [m/s^2]
  static constexpr double kDragLength = 5.0;  // [m], terminal velocity 7 m/s
  static constexpr double kTime = 1.0;        // [s]
  static constexpr int kNumSteps = 50;

  // d(position, velocity)/dt.
  template <typename T>
  static void Derivative(const T* state, T* derivative) {
    using std::sqrt;
    const T& v0 = state[2];
    const T& v1 = state[3];
    // A speed of 1 um/s at rest: sqrt has no derivative at 0.
    const T speed = sqrt(v0 * v0 + v1 * v1 + 1e-12);
    derivative[0] = v0;
    derivative[1] = v1;
    derivative[2] = -speed * v0 / kDragLength;
    derivative[3] = -speed * v1 / kDragLength - kGravity;
  }

  // From velocity x (2) to position y (2), by the classical Runge-Kutta method.
  template <typename T>
  bool operator()(const T* x, T* y) const {
    const double h = kTime / kNumSteps;
    T s[4] = {T(0.0), T(0.0), x[0], x[1]};
    T k[4][4], stage[4];
    for (int step = 0; step < kNumSteps; ++step) {
      Derivative(s, k[0]);
      for (int j = 1; j < 4; ++j) {
        const double time = j < 3 ? 0.5 * h : h;
        for (int i = 0; i < 4; ++i) stage[i] = s[i] + time * k[j - 1][i];
        Derivative(stage, k[j]);
      }
      for (int i = 0; i < 4; ++i) {
        s[i] += (h / 6.0) * (k[0][i] + 2.0 * (k[1][i] + k[2][i]) + k[3][i]);
      }
    }
    y[0] = s[0];
    y[1] = s[1];
    return true;
  }
};
// [/functor]

#endif  // SHUTTLECOCK_FLIGHT_H_
