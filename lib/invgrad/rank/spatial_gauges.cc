#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "Eigen/Geometry"
#include "invgrad/rank/pose_gauges.h"

namespace invgrad {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Quaterniond;
using Eigen::Vector3d;

enum class Rotation { kAngleAxis, kWxyz, kXyzw };

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
  constexpr double kSmall = 1e-4;  // above it, 1 - cos(angle) has 8 digits
  const double c = angle < kSmall ? 1.0 / 12.0
                                  : 1.0 / (angle * angle) -
                                        (1.0 + std::cos(angle)) /
                                            (2.0 * angle * std::sin(angle));
  const Matrix3d K = Cross(phi);
  return Matrix3d::Identity() - 0.5 * K + c * K * K;
}

void Put(const Vector3d& v, double* to) { Eigen::Map<Vector3d>{to} = v; }

// The representation of a rotation.
struct RotationView {
  Rotation kind;
  const double* values;

  Vector3d AngleAxis() const { return {values[0], values[1], values[2]}; }

  Quaterniond Quaternion() const {
    if (kind == Rotation::kWxyz) {
      return {values[0], values[1], values[2], values[3]};
    }
    return {values[3], values[0], values[1], values[2]};
  }

  Matrix3d Matrix() const {
    if (kind != Rotation::kAngleAxis) {
      return Quaternion().normalized().toRotationMatrix();
    }
    const Vector3d phi = AngleAxis();
    const double angle = phi.norm();
    if (angle == 0.0) return Matrix3d::Identity();
    return Eigen::AngleAxisd(angle, phi / angle).toRotationMatrix();
  }

  // The motion of the values for R -> exp(delta) R (left) or R exp(delta).
  void Move(const Vector3d& delta, bool left, double* motion) const {
    if (kind == Rotation::kAngleAxis) {
      const Vector3d phi = left ? AngleAxis() : Vector3d(-AngleAxis());
      Put(InverseLeftJacobian(phi) * delta, motion);
      return;
    }
    const Quaterniond d(0.0, 0.5 * delta[0], 0.5 * delta[1], 0.5 * delta[2]);
    const Quaterniond dq = left ? d * Quaternion() : Quaternion() * d;
    const bool w_first = kind == Rotation::kWxyz;
    motion[w_first ? 0 : 3] = dq.w();
    Put(dq.vec(), motion + (w_first ? 1 : 0));
  }
};

// The spatial meaning of the blocks of a group.
struct Scene {
  struct Place {
    const double* values;
    int offset;
  };
  struct Camera {
    RotationView rotation;
    Place translation;
  };
  struct Turn {
    RotationView rotation;
    int offset;
  };
  std::vector<Place> points;    // p -> p + a + delta x p
  std::vector<Turn> turns;      // R -> exp(delta) R or R exp(-delta)
  std::vector<Camera> cameras;  // t follows R and the points
};

bool IsUnit(const double* q) {
  // Quaternions may lie slightly off the sphere after an optimization.
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

// The layout of poses.
struct Layout {
  Pose pose;
  Rotation kind;
  bool rotation_first;  // before the position
  // Otherwise they are calibrations, which do not move.
  bool blocks_of_three_are_points;
};

// Adds cameras whose rotation and translation are blocks next to each other in
// the cost functions, and fills `translations` with the indices of the
// translations.
bool ReadSplitCameras(const GaugeComponent& component,
                      const Layout& layout,
                      Scene* scene,
                      std::set<int>* translations) {
  for (const std::vector<int>& arguments : component.arguments) {
    for (std::size_t i = 0; i + 1 < arguments.size(); ++i) {
      const int q = arguments[layout.rotation_first ? i : i + 1];
      const int t = arguments[layout.rotation_first ? i + 1 : i];
      const GaugeBlock& rotation = component.blocks[q];
      const GaugeBlock& translation = component.blocks[t];
      if (rotation.size != 4 || translation.size != 3) continue;
      if (!IsUnit(rotation.values)) return false;
      if (!translations->insert(t).second) continue;
      scene->cameras.push_back(
          {{QuaternionOrder(rotation, layout.kind), rotation.values},
           {translation.values, translation.offset}});
    }
  }
  return true;
}

// Interprets the blocks by a layout. False if they do not fit it.
bool ReadScene(const GaugeComponent& component,
               const Layout& layout,
               Scene* scene) {
  const bool is_camera = layout.pose == Pose::kWorldInCamera;
  const bool has_quaternions = layout.kind != Rotation::kAngleAxis;
  std::set<int> translations;
  if (is_camera && has_quaternions &&
      !ReadSplitCameras(component, layout, scene, &translations)) {
    return false;
  }
  for (std::size_t b = 0; b < component.blocks.size(); ++b) {
    const GaugeBlock& block = component.blocks[b];
    const double* x = block.values;
    if (block.size == 3) {
      if (layout.blocks_of_three_are_points &&
          translations.count(static_cast<int>(b)) == 0) {
        scene->points.push_back({x, block.offset});
      }
    } else if (has_quaternions ? block.size == 7 : block.size >= 6) {
      const int rotation_size = has_quaternions ? 4 : 3;
      const int rotation = layout.rotation_first ? 0 : 3;
      const int position = layout.rotation_first ? rotation_size : 0;
      if (has_quaternions && !IsUnit(x + rotation)) return false;
      const RotationView view = {layout.kind, x + rotation};
      const Scene::Place place = {x + position, block.offset + position};
      scene->turns.push_back({view, block.offset + rotation});
      if (is_camera) {
        scene->cameras.push_back({view, place});
      } else {
        scene->points.push_back(place);
      }
    } else if (has_quaternions && block.size == 4 && IsUnit(x)) {
      scene->turns.push_back(
          {{QuaternionOrder(block, layout.kind), x}, block.offset});
    }
  }
  // Points without poses fit all layouts, so only one layout accepts them.
  const bool has_rotations = !scene->turns.empty() || !scene->cameras.empty();
  if (!has_rotations &&
      (is_camera || has_quaternions || !layout.rotation_first)) {
    return false;
  }
  return !scene->points.empty() || !scene->cameras.empty();
}

// The generators about the centre c of the points:
//   X -> X + a + delta x (X - c) + e (X - c)
// and, for X_camera = R X + t,  t -> t - R a + R (delta x c) + e (t + R c).
bool Motions(const GaugeComponent& component,
             const Layout& layout,
             MatrixXd* motions) {
  Scene scene;
  if (!ReadScene(component, layout, &scene)) return false;
  Vector3d center = Vector3d::Zero();
  for (const Scene::Place& point : scene.points) {
    center += Eigen::Map<const Vector3d>(point.values);
  }
  if (!scene.points.empty()) {
    center /= static_cast<double>(scene.points.size());
  }
  for (int g = 0; g < motions->cols(); ++g) {
    Vector3d a = Vector3d::Zero();
    Vector3d delta = Vector3d::Zero();
    double e = 0.0;
    double& generator = g < 3 ? a[g] : g < 6 ? delta[g - 3] : e;
    generator = 1.0;
    double* motion = motions->col(g).data();
    for (const Scene::Place& point : scene.points) {
      const Vector3d p = Eigen::Map<const Vector3d>(point.values) - center;
      Put(a + delta.cross(p) + e * p, motion + point.offset);
    }
    const bool left = layout.pose == Pose::kBodyInWorld;
    for (const Scene::Turn& turn : scene.turns) {
      turn.rotation.Move(
          left ? delta : Vector3d(-delta), left, motion + turn.offset);
    }
    for (const Scene::Camera& camera : scene.cameras) {
      const Matrix3d R = camera.rotation.Matrix();
      const Vector3d t = Eigen::Map<const Vector3d>(camera.translation.values);
      Put(R * (delta.cross(center) - a) + e * (t + R * center),
          motion + camera.translation.offset);
    }
  }
  return true;
}

}  // namespace

std::vector<Gauge> SpatialGauges(bool with_scale) {
  std::vector<std::string> generators = {"translation x",
                                         "translation y",
                                         "translation z",
                                         "rotation about x",
                                         "rotation about y",
                                         "rotation about z"};
  if (with_scale) generators.push_back("scale");
  std::vector<Gauge> gauges;
  for (const bool has_points : {true, false}) {
    for (const Pose pose : {Pose::kBodyInWorld, Pose::kWorldInCamera}) {
      for (const Rotation kind :
           {Rotation::kWxyz, Rotation::kXyzw, Rotation::kAngleAxis}) {
        for (const bool rotation_first : {true, false}) {
          const Layout layout = {pose, kind, rotation_first, has_points};
          gauges.push_back(
              {with_scale ? "similarity in space" : "rigid motion in space",
               generators,
               [layout](const GaugeComponent& component, MatrixXd* motions) {
                 return Motions(component, layout, motions);
               }});
        }
      }
    }
  }
  return gauges;
}

}  // namespace invgrad
