// The cylinder of a published comparison of degenerate registrations, and its
// point-to-plane residuals. For scans of scenes use scan.h and alignment.h.
//
//   wall   radius 40, height 20: half of the points, uniform
//   floor  z = 0: the other half, uniform
//
// A point p of the scan at the pose (R, t) has the residual of the plane
// through the five nearest points of the target, if these are nearer than 1:
//
//   a = argmin sum_k (a . q_k + 1)^2,   n = a / |a|
//   r = s d,   d = n . (R p + t) + 1 / |a|,   s = 1 - 0.9 |d|
//   J = s (n, p x R^T n)
//
// s is not differentiated. A plane that is farther than 0.2 from one of its
// five points is left out, and a point with s <= 0.1.
//
// What is determined. The points are 1.3 to 1.5 apart, so that few have five
// neighbours: some 200 of 7,562 at the published start. Most of them are on the
// wall, which says nothing of z and of yaw. The form a . q = -1 has no planes
// through the origin: points of the floor are left out, or have a plane that
// stands upright across them, and most of what H says of yaw is made of these.
// What it says of z is made of some 15 planes through points of wall and floor.
// Both are the same in scan and target if the points are.
//
// Shapes:  points: 3 x N.  Units: metres, radians.
// Cost:    a search in a tree for each point.
// Source:  Hu, Chen, Jia, Wu, Tan, Waslander. DCReg: decoupled characterization
//          for efficient degenerate LiDAR registration. IJRR 2026, table 3.
//          arXiv 2509.06285. Radius, height, shares and residuals are those of
//          its cloud and program; the points are drawn here.
#ifndef PROBLEMS_REGISTRATION_CYLINDER_H_
#define PROBLEMS_REGISTRATION_CYLINDER_H_

#include <cstdint>
#include <memory>

#include "Eigen/Core"
#include "Eigen/Geometry"

namespace invgrad {

class PointTree;

// The places of the points depend on `seed` alone.
Eigen::Matrix3Xd MakeCylinder(std::uint32_t seed);

// Normal noise in each coordinate.
Eigen::Matrix3Xd WithNoise(const Eigen::Matrix3Xd& points,
                           double noise,
                           std::uint32_t seed);

// H = J^T J and gradient = J^T r. The translation comes first; the rotation is
// in the scan's axes.
struct LocalPlaneSums {
  Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();
  double cost = 0.0;  // 1/2 |r|^2
  int num_points = 0;
};

class LocalPlanes {
 public:
  explicit LocalPlanes(Eigen::Matrix3Xd target);
  ~LocalPlanes();

  LocalPlaneSums SumsAt(const Eigen::Matrix3Xd& scan,
                        const Eigen::Isometry3d& pose) const;

 private:
  const Eigen::Matrix3Xd target_;
  const std::unique_ptr<PointTree> tree_;
};

// t + step_0..2, R exp([step_3..5]).
Eigen::Isometry3d Moved(const Eigen::Isometry3d& pose,
                        const Eigen::Matrix<double, 6, 1>& step);

}  // namespace invgrad

#endif  // PROBLEMS_REGISTRATION_CYLINDER_H_
