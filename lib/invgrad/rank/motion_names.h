// Names the elements of a space of velocity fields: translations, rotations and
// scales, about blocks where possible.
//
//   X -> a + delta x (X - c) + e (X - c),   fields: (a, delta, e)
//
//   translations T  { delta = 0, e = 0 }    "translation y"
//   rotations       { e = 0 } modulo T      "rotation about `pose 0`"
//   scales          { delta = 0 } modulo T  "scale about `camera 0`"
//
// A rotation or a scale is about a point that it moves by an element of T. No
// point is named if any will do. What remains, as a screw, has no name.
//
// Shapes:  fields: 7 x k, independent columns; in the plane, rows 2 to 4 are
//          zero.
// Cost:    O(landmarks).
#ifndef INVGRAD_RANK_MOTION_NAMES_H_
#define INVGRAD_RANK_MOTION_NAMES_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/rank_report.h"

namespace invgrad {

using MotionField = Eigen::Matrix<double, 7, 1>;

// A place that has a name: a point, or a camera's centre.
struct Landmark {
  Eigen::Vector3d position;
  std::vector<const GaugeBlock*> blocks;  // not owned
};

struct NamedField {
  std::string name;
  MotionField field;
};

std::vector<NamedField> NameFields(const Eigen::MatrixXd& fields,
                                   const std::vector<Landmark>& landmarks,
                                   const Eigen::Vector3d& center,
                                   bool in_space);

}  // namespace invgrad

#endif  // INVGRAD_RANK_MOTION_NAMES_H_
