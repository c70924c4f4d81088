#include "invgrad/rank/gauge.h"

#include <cmath>
#include <map>
#include <set>

#include "Eigen/Geometry"

namespace invgrad {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;

enum class Rotation { kAngleAxis, kWxyz, kXyzw };

// Which convention a pose follows.
enum class Pose { kBodyInWorld, kWorldInCamera };

Matrix3d Cross(const Vector3d& v) {
  Matrix3d result;
  result << 0.0, -v[2], v[1], v[2], 0.0, -v[0], -v[1], v[0], 0.0;
  return result;
}

// d(phi) for R(phi) -> exp(delta) R(phi), per delta: the inverse of SO(3)'s
// left Jacobian.
Matrix3d InverseLeftJacobian(const Vector3d& phi) {
  const double angle = phi.norm();
  constexpr double kSmall = 1e-4;  // beyond it, 1 - cos(angle) has 8 digits
  const double c = angle < kSmall ? 1.0 / 12.0
                                  : 1.0 / (angle * angle) -
                                        (1.0 + std::cos(angle)) /
                                            (2.0 * angle * std::sin(angle));
  const Matrix3d K = Cross(phi);
  return Matrix3d::Identity() - 0.5 * K + c * K * K;
}

void Put(const Vector3d& v, double* to) { Eigen::Map<Vector3d>{to} = v; }

// A rotation as stored: its matrix, and how it moves.
struct RotationView {
  Rotation kind;
  const double* values;

  Eigen::Quaterniond Quaternion() const {
    if (kind == Rotation::kWxyz) {
      return {values[0], values[1], values[2], values[3]};
    }
    return {values[3], values[0], values[1], values[2]};
  }

  Matrix3d Matrix() const {
    if (kind != Rotation::kAngleAxis) {
      return Quaternion().normalized().toRotationMatrix();
    }
    const Vector3d phi(values[0], values[1], values[2]);
    const double angle = phi.norm();
    if (angle == 0.0) return Matrix3d::Identity();
    return Eigen::AngleAxisd(angle, phi / angle).toRotationMatrix();
  }

  // exp(delta) R (left) or R exp(delta).
  void Move(const Vector3d& delta, bool left, double* motion) const {
    if (kind == Rotation::kAngleAxis) {
      const Vector3d phi(values[0], values[1], values[2]);
      Put(InverseLeftJacobian(left ? phi : Vector3d(-phi)) * delta, motion);
      return;
    }
    const Eigen::Quaterniond d(
        0.0, 0.5 * delta[0], 0.5 * delta[1], 0.5 * delta[2]);
    const Eigen::Quaterniond dq = left ? d * Quaternion() : Quaternion() * d;
    if (kind == Rotation::kWxyz) {
      motion[0] = dq.w();
      Put(dq.vec(), motion + 1);
    } else {
      Put(dq.vec(), motion);
      motion[3] = dq.w();
    }
  }
};

// What the blocks of a component mean in space.
struct SpatialScene {
  struct Part {
    const double* values;
    int offset;
  };
  struct CameraPose {
    RotationView rotation;
    Part translation;
  };
  struct Turn {
    RotationView rotation;
    int offset;
  };
  std::vector<Part> points;         // p -> p + a + delta x p
  std::vector<Turn> turns;          // R -> exp(delta) R or R exp(-delta)
  std::vector<CameraPose> cameras;  // t follows R and the points
};

bool IsUnit(const double* q) {
  // Optimizers leave quaternions a little off the sphere.
  constexpr double kTolerance = 1e-3;
  return std::abs(Eigen::Map<const Eigen::Vector4d>(q).norm() - 1.0) <
         kTolerance;
}

// The manifold's own order, if it has one.
Rotation QuaternionOrder(const GaugeBlock& block, Rotation otherwise) {
  if (dynamic_cast<const ceres::QuaternionManifold*>(block.manifold)) {
    return Rotation::kWxyz;
  }
  if (dynamic_cast<const ceres::EigenQuaternionManifold*>(block.manifold)) {
    return Rotation::kXyzw;
  }
  return otherwise;
}

// How poses are stored.
struct SpatialLayout {
  Pose pose;
  Rotation kind;
  bool rotation_first;  // before the position
  // Otherwise they are calibrations, which do not move.
  bool blocks_of_three_are_points;
};

// Reads the blocks by a layout. False if they cannot be that.
bool ReadScene(const GaugeComponent& component,
               const SpatialLayout& layout,
               SpatialScene* scene) {
  const auto [pose, kind, rotation_first, has_points] = layout;
  const bool is_camera = pose == Pose::kWorldInCamera;
  std::set<int> translations;  // blocks that follow a camera's rotation
  const auto add_pose = [&](const RotationView& rotation,
                            int rotation_offset,
                            const SpatialScene::Part& position) {
    scene->turns.push_back({rotation, rotation_offset});
    if (is_camera) {
      scene->cameras.push_back({rotation, position});
    } else {
      scene->points.push_back(position);
    }
  };
  if (is_camera && kind != Rotation::kAngleAxis) {
    for (const std::vector<int>& arguments : component.arguments) {
      for (std::size_t i = 0; i + 1 < arguments.size(); ++i) {
        const int q = arguments[rotation_first ? i : i + 1];
        const int t = arguments[rotation_first ? i + 1 : i];
        const GaugeBlock& rotation = component.blocks[q];
        const GaugeBlock& translation = component.blocks[t];
        if (rotation.size != 4 || translation.size != 3) continue;
        if (!IsUnit(rotation.values)) return false;
        if (!translations.insert(t).second) continue;
        scene->cameras.push_back(
            {{QuaternionOrder(rotation, kind), rotation.values},
             {translation.values, translation.offset}});
      }
    }
  }
  for (std::size_t b = 0; b < component.blocks.size(); ++b) {
    const GaugeBlock& block = component.blocks[b];
    const double* x = block.values;
    if (block.size == 3) {
      if (has_points && translations.count(static_cast<int>(b)) == 0) {
        scene->points.push_back({x, block.offset});
      }
    } else if (kind == Rotation::kAngleAxis && block.size >= 6) {
      const int rotation = rotation_first ? 0 : 3;
      const int position = 3 - rotation;
      add_pose({kind, x + rotation},
               block.offset + rotation,
               {x + position, block.offset + position});
    } else if (kind != Rotation::kAngleAxis && block.size == 7) {
      const int rotation = rotation_first ? 0 : 3;
      const int position = rotation_first ? 4 : 0;
      if (!IsUnit(x + rotation)) return false;
      add_pose({kind, x + rotation},
               block.offset + rotation,
               {x + position, block.offset + position});
    } else if (kind != Rotation::kAngleAxis && block.size == 4 && IsUnit(x)) {
      scene->turns.push_back({{QuaternionOrder(block, kind), x}, block.offset});
    }
  }
  // One of the layouts stands for points alone.
  const bool has_rotations = !scene->turns.empty() || !scene->cameras.empty();
  if (!has_rotations &&
      (is_camera || kind != Rotation::kAngleAxis || !rotation_first)) {
    return false;
  }
  return !scene->points.empty() || !scene->cameras.empty();
}

// The generators about the centre c of the points:
//   X -> X + a + delta x (X - c) + e (X - c)
// and, for X_camera = R X + t,  t -> t - R a + R (delta x c) + e (t + R c).
bool SpatialMotions(const GaugeComponent& component,
                    const SpatialLayout& layout,
                    MatrixXd* motions) {
  SpatialScene scene;
  if (!ReadScene(component, layout, &scene)) return false;
  Vector3d center = Vector3d::Zero();
  for (const auto& point : scene.points) {
    center += Eigen::Map<const Vector3d>(point.values);
  }
  if (!scene.points.empty()) {
    center /= static_cast<double>(scene.points.size());
  }
  const int num_generators = static_cast<int>(motions->cols());
  for (int g = 0; g < num_generators; ++g) {
    Vector3d a = Vector3d::Zero();
    Vector3d delta = Vector3d::Zero();
    double e = 0.0;
    if (g < 3) {
      a[g] = 1.0;
    } else if (g < 6) {
      delta[g - 3] = 1.0;
    } else {
      e = 1.0;
    }
    double* motion = motions->col(g).data();
    for (const auto& point : scene.points) {
      const Vector3d p = Eigen::Map<const Vector3d>(point.values) - center;
      Put(a + delta.cross(p) + e * p, motion + point.offset);
    }
    const bool left = layout.pose == Pose::kBodyInWorld;
    for (const auto& turn : scene.turns) {
      turn.rotation.Move(
          left ? delta : Vector3d(-delta), left, motion + turn.offset);
    }
    for (const auto& camera : scene.cameras) {
      const Matrix3d R = camera.rotation.Matrix();
      const Vector3d t = Eigen::Map<const Vector3d>(camera.translation.values);
      Put(R * (delta.cross(center) - a) + e * (t + R * center),
          motion + camera.translation.offset);
    }
  }
  return true;
}

std::vector<SpatialLayout> SpatialLayouts() {
  std::vector<SpatialLayout> layouts;
  for (const bool has_points : {true, false}) {
    for (const Pose pose : {Pose::kBodyInWorld, Pose::kWorldInCamera}) {
      for (const Rotation kind :
           {Rotation::kWxyz, Rotation::kXyzw, Rotation::kAngleAxis}) {
        for (const bool rotation_first : {true, false}) {
          layouts.push_back({pose, kind, rotation_first, has_points});
        }
      }
    }
  }
  return layouts;
}

// Blocks of sizes 1 and 2 may also be calibrations, which do not move.
struct PlanarLayout {
  bool blocks_of_one_are_angles;
  bool blocks_of_two_are_points;
  bool split;  // x, y and angle are blocks of their own
};

bool PlanarMotions(const GaugeComponent& component,
                   const PlanarLayout& layout,
                   MatrixXd* motions) {
  struct Point {
    const double* x;
    const double* y;
    int x_offset;
    int y_offset;
  };
  std::vector<Point> points;
  std::vector<int> angles;
  if (layout.split) {
    std::map<int, int> roles;  // of blocks: 0, 1, 2 for x, y, angle
    for (const std::vector<int>& arguments : component.arguments) {
      if (arguments.size() % 3 != 0) return false;
      for (std::size_t i = 0; i < arguments.size(); ++i) {
        const int role = static_cast<int>(i % 3);
        const GaugeBlock& block = component.blocks[arguments[i]];
        if (block.size != 1) return false;
        const auto [it, is_new] = roles.insert({arguments[i], role});
        if (it->second != role) return false;
        if (!is_new) continue;
        if (role == 2) angles.push_back(block.offset);
        if (role != 0) continue;
        const GaugeBlock& y = component.blocks[arguments[i + 1]];
        points.push_back({block.values, y.values, block.offset, y.offset});
      }
    }
  } else {
    for (const GaugeBlock& block : component.blocks) {
      if (block.size == 3 ||
          (block.size == 2 && layout.blocks_of_two_are_points)) {
        points.push_back(
            {block.values, block.values + 1, block.offset, block.offset + 1});
      }
      if (block.size == 3) angles.push_back(block.offset + 2);
      if (block.size == 1 && layout.blocks_of_one_are_angles) {
        angles.push_back(block.offset);
      }
    }
  }
  if (points.empty()) return false;
  Vector2d center = Vector2d::Zero();
  for (const Point& p : points) center += Vector2d(*p.x, *p.y);
  center /= static_cast<double>(points.size());
  for (const Point& p : points) {
    const Vector2d r = Vector2d(*p.x, *p.y) - center;
    (*motions)(p.x_offset, 0) = 1.0;
    (*motions)(p.y_offset, 1) = 1.0;
    if (motions->cols() > 2) {
      (*motions)(p.x_offset, 2) = -r[1];
      (*motions)(p.y_offset, 2) = r[0];
    }
    if (motions->cols() > 3) {
      (*motions)(p.x_offset, 3) = r[0];
      (*motions)(p.y_offset, 3) = r[1];
    }
  }
  if (motions->cols() > 2) {
    for (const int offset : angles) (*motions)(offset, 2) = 1.0;
  }
  return true;
}

Gauge Translation(int size) {
  Gauge gauge;
  gauge.name =
      "common translation of the blocks of size " + std::to_string(size);
  for (int i = 0; i < size; ++i) {
    gauge.generators.push_back(size == 1 ? "translation"
                                         : "translation of component " +
                                               std::to_string(i));
  }
  gauge.motions = [size](const GaugeComponent& component, MatrixXd* motions) {
    int num_blocks = 0;
    for (const GaugeBlock& block : component.blocks) {
      if (block.size != size) continue;
      ++num_blocks;
      motions->middleRows(block.offset, size).setIdentity();
    }
    return num_blocks > 1;
  };
  return gauge;
}

// All blocks times a common factor.
Gauge CommonFactor() {
  Gauge gauge;
  gauge.name = "common factor of all blocks";
  gauge.generators = {"scale"};
  gauge.motions = [](const GaugeComponent& component, MatrixXd* motions) {
    for (const GaugeBlock& block : component.blocks) {
      motions->col(0).segment(block.offset, block.size) =
          Eigen::Map<const Eigen::VectorXd>(block.values, block.size);
    }
    return component.blocks.size() > 1;
  };
  return gauge;
}

// Blocks that are first arguments times a factor, those that are second ones
// divided by it.
Gauge FactorOfProduct() {
  Gauge gauge;
  gauge.name =
      "factor between first and second arguments, of which the residuals see "
      "only products";
  gauge.generators = {"factor"};
  gauge.motions = [](const GaugeComponent& component, MatrixXd* motions) {
    std::map<int, std::size_t> places;
    for (const std::vector<int>& arguments : component.arguments) {
      if (arguments.size() != 2) return false;
      for (std::size_t i = 0; i < 2; ++i) {
        if (places.insert({arguments[i], i}).first->second != i) return false;
      }
    }
    for (const auto& [b, place] : places) {
      const GaugeBlock& block = component.blocks[b];
      motions->col(0).segment(block.offset, block.size) =
          (place == 0 ? 1.0 : -1.0) *
          Eigen::Map<const Eigen::VectorXd>(block.values, block.size);
    }
    return true;
  };
  return gauge;
}

}  // namespace

std::vector<Gauge> BuiltInGauges() {
  std::vector<Gauge> gauges = {FactorOfProduct(), CommonFactor()};
  // Blocks of more components seldom are places.
  constexpr int kLargestPlace = 3;
  for (int size = 1; size <= kLargestPlace; ++size) {
    gauges.push_back(Translation(size));
  }
  const std::vector<std::string> in_plane = {
      "translation x", "translation y", "rotation", "scale"};
  const std::vector<std::string> in_space = {"translation x",
                                             "translation y",
                                             "translation z",
                                             "rotation about x",
                                             "rotation about y",
                                             "rotation about z",
                                             "scale"};
  for (const bool with_scale : {false, true}) {
    const std::string name = with_scale ? "similarity" : "rigid motion";
    for (const PlanarLayout layout : {PlanarLayout{false, true, false},
                                      PlanarLayout{true, true, false},
                                      PlanarLayout{false, false, false},
                                      PlanarLayout{true, false, false},
                                      PlanarLayout{false, false, true}}) {
      gauges.push_back(
          {name + " in the plane",
           {in_plane.begin(), in_plane.begin() + (with_scale ? 4 : 3)},
           [layout](const GaugeComponent& component, MatrixXd* motions) {
             return PlanarMotions(component, layout, motions);
           }});
    }
    for (const SpatialLayout& layout : SpatialLayouts()) {
      gauges.push_back(
          {name + " in space",
           {in_space.begin(), in_space.begin() + (with_scale ? 7 : 6)},
           [layout](const GaugeComponent& component, MatrixXd* motions) {
             return SpatialMotions(component, layout, motions);
           }});
    }
  }
  return gauges;
}

}  // namespace invgrad
