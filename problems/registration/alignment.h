// Point-to-plane alignment of two scans as a ceres::Problem.
//
//   cost = 1/2 sum of rho(r_i^2),   r_i = n_j . (R p_i + t - q_j)
//
// p_i: the points of a scan; q_j, n_j: points and normals of the target, which
// is the scan before; j: the target's nearest point to R p_i + t at the start.
//
// The unknowns are two parameter blocks, each with one unit: t (3), and the
// unit quaternion of R (4) on ceres::EigenQuaternionManifold (3).
//
// Edges. The pattern of rays moves with the sensor. What goes wrong where two
// walls meet goes wrong at the same place of each scan, and pulls every
// alignment towards no motion. Two parts of the problem prevent that:
//
//   normals   The least principal axes of the 8 nearest points. A point takes
//             part if these lie on a plane, and not on two: the spread along
//             the normal (standard deviation) is at most a fifth of the second
//             one, and at most twice the noise of the ranges, or 5 mm.
//   matches   A point near an edge may have its nearest on the other wall. rho
//             is Tukey's loss, which ignores a residual beyond 5 cm (an error
//             of the start) + 5 times the noise.
//
// Without guards_edges the normals have the first limit alone, and rho is
// Huber's loss, linear above 5 cm, so that such matches pull.
//
// Shapes:  points: 3 x N.
// Units:   metres times `unit`.
// Cost:    one search in a tree for each point.
// Source:  the matches of Chen, Medioni. Object Modelling by Registration of
//          Multiple Range Images. Image and Vision Computing 10(3), 1992.
#ifndef PROBLEMS_REGISTRATION_ALIGNMENT_H_
#define PROBLEMS_REGISTRATION_ALIGNMENT_H_

#include <memory>

#include "Eigen/Core"
#include "Eigen/Geometry"
#include "ceres/problem.h"

namespace invgrad {

class PointTree;

// From the scan's frame to the target's.
struct RelativePose {
  Eigen::Vector3d t{0.0, 0.0, 0.0};
  Eigen::Quaterniond q{1.0, 0.0, 0.0, 0.0};
};

struct AlignmentOptions {
  double noise = 0.01;  // standard deviation of the ranges [m]
  double unit = 1.0;    // 1000: millimetres
  bool guards_edges = true;
};

class AlignmentTarget {
 public:
  AlignmentTarget(Eigen::Matrix3Xd points, const AlignmentOptions& options);
  ~AlignmentTarget();

  // Adds the residuals of `scan` at the current pose, and the two blocks.
  // Returns their number.
  int AddResiduals(const Eigen::Matrix3Xd& scan,
                   RelativePose* pose,
                   ceres::Problem* problem) const;

  // The estimated error of the normals, in each tangent direction, root mean
  // square [rad]: of a plane fit to k points with the variances l_0 (along the
  // normal) and l_1 it is (l_0 / ((k - 3) l_1))^(1/2). It knows of noise, not
  // of edges. 0: there are no normals.
  double normal_error() const { return normal_error_; }
  // 3 x N; zero where there is no plane.
  const Eigen::Matrix3Xd& normals() const { return normals_; }

 private:
  void FindNormals();

  const Eigen::Matrix3Xd points_;
  const AlignmentOptions options_;
  std::unique_ptr<PointTree> tree_;
  Eigen::Matrix3Xd normals_;
  double normal_error_ = 0.0;
};

}  // namespace invgrad

#endif  // PROBLEMS_REGISTRATION_ALIGNMENT_H_
