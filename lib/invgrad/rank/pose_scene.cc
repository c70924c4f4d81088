#include "invgrad/rank/pose_scene.h"

#include <cmath>
#include <map>
#include <set>

#include "ceres/manifold.h"

namespace invgrad {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

// d(phi) for R(phi) -> exp(delta) R(phi): the inverse of SO(3)'s left Jacobian
// times delta.
Vector3d AngleAxisMotion(const Vector3d& phi, const Vector3d& delta) {
  const double angle = phi.norm();
  constexpr double kSmall = 1e-4;  // above it, 1 - cos(angle) has 8 digits
  const double c = angle < kSmall ? 1.0 / 12.0
                                  : 1.0 / (angle * angle) -
                                        (1.0 + std::cos(angle)) /
                                            (2.0 * angle * std::sin(angle));
  const Vector3d turned = phi.cross(delta);
  return delta - 0.5 * turned + c * phi.cross(turned);
}

void Put(const Vector3d& v, double* to) { Eigen::Map<Vector3d>{to} = v; }

// Arguments of the cost functions in threes. One or two of them are no poses,
// but may be a prior on parts of one. False if none are poses.
bool ReadSplitPoses(const GaugeComponent& component, PoseScene* scene) {
  std::map<int, int> roles;  // of blocks: 0, 1, 2 for x, y, angle
  for (const std::vector<int>& arguments : component.arguments) {
    if (arguments.size() < 3) continue;
    if (arguments.size() % 3 != 0) return false;
    for (std::size_t i = 0; i < arguments.size(); ++i) {
      const int role = static_cast<int>(i % 3);
      const GaugeBlock& block = component.blocks[arguments[i]];
      if (block.size != 1) return false;
      const auto [it, is_new] = roles.insert({arguments[i], role});
      if (it->second != role) return false;
      if (is_new && role == 0) {
        const int next = arguments[i + 1];
        const GaugeBlock& y = component.blocks[next];
        scene->points.push_back({{*block.values, *y.values, 0.0},
                                 {block.offset, y.offset},
                                 {arguments[i], next}});
      } else if (is_new && role == 2) {
        scene->turns.push_back({Rotation::kAngle, block.values, block.offset});
      }
    }
  }
  return !roles.empty();
}

// Quaternions may lie slightly off the sphere after an optimization.
bool IsUnit(const double* q) {
  return std::abs(Eigen::Map<const Eigen::Vector4d>(q).norm() - 1.0) < 1e-3;
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

// Adds cameras whose rotation and translation are blocks next to each other in
// the cost functions, and fills the indices of the translations.
bool ReadSplitCameras(const GaugeComponent& component,
                      const SpatialLayout& layout,
                      PoseScene* scene,
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
      const Turn turn = {
          QuaternionOrder(rotation, layout.kind), rotation.values, 0};
      scene->cameras.push_back(
          {turn.Matrix(), Vector3d(translation.values), translation.offset, t});
    }
  }
  return true;
}

}  // namespace

Quaterniond Turn::Quaternion() const {
  if (kind == Rotation::kWxyz) {
    return {values[0], values[1], values[2], values[3]};
  }
  return Quaterniond(values);
}

Matrix3d Turn::Matrix() const {
  if (kind != Rotation::kAngleAxis) {
    return Quaternion().normalized().toRotationMatrix();
  }
  const Vector3d phi(values);
  return Eigen::AngleAxisd(phi.norm(), phi.normalized()).toRotationMatrix();
}

void Turn::Move(const Vector3d& delta, bool left, double* motion) const {
  if (kind == Rotation::kAngle) {
    *motion = delta[2];
  } else if (kind == Rotation::kAngleAxis) {
    const Vector3d phi(values);
    Put(AngleAxisMotion(left ? phi : Vector3d(-phi), delta), motion);
  } else {
    const Quaterniond d(0.0, 0.5 * delta[0], 0.5 * delta[1], 0.5 * delta[2]);
    const Quaterniond dq = left ? d * Quaternion() : Quaternion() * d;
    const bool w_first = kind == Rotation::kWxyz;
    motion[w_first ? 0 : 3] = dq.w();
    Put(dq.vec(), motion + (w_first ? 1 : 0));
  }
}

bool ReadScene(const GaugeComponent& component,
               const PlanarLayout& layout,
               PoseScene* scene) {
  if (layout.split) return ReadSplitPoses(component, scene);
  for (std::size_t b = 0; b < component.blocks.size(); ++b) {
    const GaugeBlock& block = component.blocks[b];
    const double* x = block.values;
    if (block.size == 3 ||
        (block.size == 2 && layout.blocks_of_two_are_points)) {
      scene->points.push_back({{x[0], x[1], 0.0},
                               {block.offset, block.offset + 1},
                               {static_cast<int>(b)}});
    }
    if (block.size == 3 ||
        (block.size == 1 && layout.blocks_of_one_are_angles)) {
      const int last = block.size - 1;
      scene->turns.push_back({Rotation::kAngle, x + last, block.offset + last});
    }
  }
  return true;
}

bool ReadScene(const GaugeComponent& component,
               const SpatialLayout& layout,
               PoseScene* scene) {
  const bool has_quaternions = layout.kind != Rotation::kAngleAxis;
  const auto add_point = [scene](const double* x, int offset, int block) {
    scene->points.push_back(
        {Vector3d(x), {offset, offset + 1, offset + 2}, {block}});
  };
  std::set<int> translations;
  if (layout.is_camera && has_quaternions &&
      !ReadSplitCameras(component, layout, scene, &translations)) {
    return false;
  }
  for (int b = 0; b < static_cast<int>(component.blocks.size()); ++b) {
    const GaugeBlock& block = component.blocks[b];
    const double* x = block.values;
    if (block.size == 3) {
      if (layout.blocks_of_three_are_points && translations.count(b) == 0) {
        add_point(x, block.offset, b);
      }
    } else if (has_quaternions ? block.size == 7 : block.size >= 6) {
      const int rotation = layout.rotation_first ? 0 : 3;
      const int position = !layout.rotation_first ? 0 : has_quaternions ? 4 : 3;
      if (has_quaternions && !IsUnit(x + rotation)) return false;
      const Turn turn = {layout.kind, x + rotation, block.offset + rotation};
      scene->turns.push_back(turn);
      if (layout.is_camera) {
        scene->cameras.push_back({turn.Matrix(),
                                  Vector3d(x + position),
                                  block.offset + position,
                                  b});
      } else {
        add_point(x + position, block.offset + position, b);
      }
    } else if (has_quaternions && block.size == 4 && IsUnit(x)) {
      scene->turns.push_back(
          {QuaternionOrder(block, layout.kind), x, block.offset});
    }
  }
  // Points without poses fit all layouts, so only one layout accepts them.
  return !scene->turns.empty() || !scene->cameras.empty() ||
         (!layout.is_camera && !has_quaternions && layout.rotation_first);
}

}  // namespace invgrad
