// Scans of scenes with known geometry, from a known path: for the registration
// of scans along directions that a scene does not determine.
//
//   scene      walls                                         undetermined
//   room       a box of 15 x 8 x 3                           -
//   corridor   2.4 wide, 2.5 high, endless along x           x
//   tunnel     a tube of radius 2 along x, with a floor      x
//   plane      a floor 1.5 below the sensor                  x, y, yaw
//   cylinder   a tube of radius 2 along x                    x, roll
//
// A scan has one ray for each of 60 azimuths and 24 elevations, from -60 to 40
// degrees, in the sensor's frame. The range has normal noise, and a share of
// the rays returns a uniform range in its place. Ranges below 0.5 and above 15
// are left out.
//
// The sensor advances 0.1 along x a scan, and swings sideways and in yaw (in
// the cylinder it stays on the axis). Its axes are turned against those of the
// scene by a yaw of 20 degrees, so that no coordinate is undetermined alone.
//
// Shapes:  points: 3 x number of points, in the sensor's frame.
// Units:   metres times `unit`: 1000 for millimetres; radians.
#ifndef PROBLEMS_REGISTRATION_SCAN_H_
#define PROBLEMS_REGISTRATION_SCAN_H_

#include <cstdint>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/Geometry"

namespace invgrad {

struct Scene {
  struct Wall {
    Eigen::Vector3d normal;  // outwards
    double distance;         // normal . x <= distance inside
  };

  std::string name;
  std::vector<Wall> walls;
  double radius = 0.0;  // of a tube along x; 0: none
  bool swings = true;
  // x, y, z, roll, pitch, yaw in the scene's frame.
  Eigen::Matrix<bool, 6, 1> is_undetermined =
      Eigen::Matrix<bool, 6, 1>::Constant(false);

  // From a place inside to the nearest wall; infinity if there is none.
  double Range(const Eigen::Vector3d& origin,
               const Eigen::Vector3d& direction) const;
};

// Room, corridor, tunnel, plane, cylinder.
const std::vector<Scene>& Scenes();

// The sensor's pose in the scene at scan k.
Eigen::Isometry3d PathPose(const Scene& scene, int k);

struct ScanOptions {
  double noise = 0.01;     // standard deviation of the ranges [m]
  double outliers = 0.05;  // share of the rays
  double unit = 1.0;       // 1000: millimetres
};

// The scan at `pose`; the same for the same seed.
Eigen::Matrix3Xd MakeScan(const Scene& scene,
                          const Eigen::Isometry3d& pose,
                          const ScanOptions& options,
                          std::uint32_t seed);

}  // namespace invgrad

#endif  // PROBLEMS_REGISTRATION_SCAN_H_
