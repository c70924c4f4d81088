// What parameter blocks mean in the plane or in space: points, rotations and
// cameras, read by a layout (gauge.h lists them).
#ifndef INVGRAD_RANK_POSE_SCENE_H_
#define INVGRAD_RANK_POSE_SCENE_H_

#include <vector>

#include "Eigen/Core"
#include "Eigen/Geometry"
#include "invgrad/rank_report.h"

namespace invgrad {

// Of poses in the plane (z = 0, rotations about z) and in space.
enum class Rotation { kAngle, kAngleAxis, kWxyz, kXyzw };

// Rotating values of a block.
struct Turn {
  Rotation kind;
  const double* values;
  int offset;  // in a motion

  Eigen::Quaterniond Quaternion() const;

  // Of a rotation in space.
  Eigen::Matrix3d Matrix() const;

  // The motion of the values for R -> exp(delta) R (left) or R exp(delta).
  void Move(const Eigen::Vector3d& delta, bool left, double* motion) const;
};

struct PoseScene {
  struct Point {
    Eigen::Vector3d place;
    std::vector<int> offsets;  // of its entries: x, y and in space z
    std::vector<int> blocks;   // indices of the component's blocks
  };
  struct Camera {
    Eigen::Matrix3d R;
    Eigen::Vector3d t;
    int offset;  // of t
    int block;   // with t
  };
  std::vector<Point> points;    // p -> p + a + delta x p
  std::vector<Turn> turns;      // R -> exp(delta) R or R exp(-delta)
  std::vector<Camera> cameras;  // t follows R and the points
};

// Poses in the plane. Blocks of sizes 1 and 2 may also be calibrations, which do
// not move.
struct PlanarLayout {
  bool blocks_of_one_are_angles;
  bool blocks_of_two_are_points;
  bool split;  // x, y and angle are blocks of their own
};

// Poses in space.
struct SpatialLayout {
  bool is_camera;  // from the world to the camera, or the body's in the world
  Rotation kind;
  bool rotation_first;  // before the position
  // Otherwise they are calibrations, which do not move.
  bool blocks_of_three_are_points;
};

// False if the blocks do not fit the layout.
bool ReadScene(const GaugeComponent& component,
               const PlanarLayout& layout,
               PoseScene* scene);
bool ReadScene(const GaugeComponent& component,
               const SpatialLayout& layout,
               PoseScene* scene);

}  // namespace invgrad

#endif  // INVGRAD_RANK_POSE_SCENE_H_
