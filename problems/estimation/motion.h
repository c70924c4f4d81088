// Rigid motions of the plane and of space, for residuals on any scalar type.
//
//   2D   x y theta                 or a rotation and a translation
//   3D   x y z qx qy qz qw         with a quaternion of length one
//
// (a * b) p = a (b p); Inverse(a) * a is the motion that moves nothing.
#ifndef PROBLEMS_ESTIMATION_MOTION_H_
#define PROBLEMS_ESTIMATION_MOTION_H_

#include <cmath>
#include <type_traits>

#include "Eigen/Core"
#include "Eigen/Geometry"

namespace invgrad {

// The same angle in [-pi, pi).
template <typename T>
T NormalizeAngle(const T& angle) {
  using std::floor;
  constexpr double kHalfTurn = EIGEN_PI;
  return angle -
         2.0 * kHalfTurn * floor((angle + kHalfTurn) / (2.0 * kHalfTurn));
}

template <typename T, int kDimension>
struct Motion {
  using Rotation = std::conditional_t<kDimension == 2,
                                      Eigen::Rotation2D<T>,
                                      Eigen::Quaternion<T>>;
  using Point = Eigen::Matrix<T, kDimension, 1>;

  Rotation rotation;
  Point translation;

  static Motion Identity() { return {Rotation::Identity(), Point::Zero()}; }

  Motion operator*(const Motion& b) const {
    return {rotation * b.rotation, *this * b.translation};
  }
  Point operator*(const Point& p) const { return translation + rotation * p; }

  template <typename S>
  Motion<S, kDimension> Cast() const {
    return {rotation.template cast<S>(), translation.template cast<S>()};
  }
};

template <typename T>
Eigen::Rotation2D<T> Inverse(const Eigen::Rotation2D<T>& rotation) {
  return rotation.inverse();
}
template <typename T>
Eigen::Quaternion<T> Inverse(const Eigen::Quaternion<T>& rotation) {
  return rotation.conjugate();
}

// a^-1 b and a^-1 p: b and p as a sees them. Exact far from the origin, too,
// because positions are subtracted first.
template <typename T, int kDimension>
Eigen::Matrix<T, kDimension, 1> SeenFrom(
    const Motion<T, kDimension>& a, const Eigen::Matrix<T, kDimension, 1>& p) {
  return Inverse(a.rotation) *
         Eigen::Matrix<T, kDimension, 1>(p - a.translation);
}
template <typename T, int kDimension>
Motion<T, kDimension> SeenFrom(const Motion<T, kDimension>& a,
                               const Motion<T, kDimension>& b) {
  return {Inverse(a.rotation) * b.rotation, SeenFrom(a, b.translation)};
}

template <typename T, int kDimension>
Motion<T, kDimension> Inverse(const Motion<T, kDimension>& a) {
  return SeenFrom(a, Motion<T, kDimension>::Identity());
}

template <typename T>
Motion<T, 2> ToMotion(const T* x_y_theta) {
  return {Eigen::Rotation2D<T>(x_y_theta[2]), {x_y_theta[0], x_y_theta[1]}};
}
template <typename T>
Motion<T, 3> ToMotion(const T* position, const T* quaternion) {
  return {Eigen::Map<const Eigen::Quaternion<T>>(quaternion),
          Eigen::Map<const Eigen::Matrix<T, 3, 1>>(position)};
}

// Of the numbers of a pose.
template <int kDimension>
Motion<double, kDimension> ToMotion(const double* pose) {
  if constexpr (kDimension == 2) {
    return ToMotion(pose);
  } else {
    return ToMotion(pose, pose + 3);
  }
}

// g2o's coordinates of a motion, which are small if it is: translation and
// angle in [-pi, pi); or translation and vec(q) of the quaternion with q_w >= 0,
// about half the rotation vector.
template <typename T>
Eigen::Matrix<T, 3, 1> Coordinates(const Motion<T, 2>& a) {
  return {
      a.translation[0], a.translation[1], NormalizeAngle(a.rotation.angle())};
}
template <typename T>
Eigen::Matrix<T, 6, 1> Coordinates(const Motion<T, 3>& a) {
  Eigen::Matrix<T, 6, 1> coordinates;
  coordinates << a.translation, a.rotation.vec();
  if (a.rotation.w() < 0.0) coordinates.template tail<3>() *= T(-1.0);
  return coordinates;
}

// The numbers of a pose.
inline Eigen::Vector3d ToPose(const Motion<double, 2>& a) {
  return Coordinates(a);
}
inline Eigen::Matrix<double, 7, 1> ToPose(const Motion<double, 3>& a) {
  Eigen::Matrix<double, 7, 1> pose;
  pose << a.translation, a.rotation.normalized().coeffs();
  return pose;
}

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_MOTION_H_
