#include "invgrad/rank/pose_gauge.h"

#include <string>
#include <utility>
#include <vector>

#include "fmt/core.h"
#include "invgrad/rank/motion_names.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

// Generator g is the unit vector of row [g] of a field (motion_names.h).
std::vector<int> GeneratorRows(bool in_space, bool with_scale) {
  std::vector<int> rows = {0, 1, 5};
  if (in_space) rows = {0, 1, 2, 3, 4, 5};
  if (with_scale) rows.push_back(6);
  return rows;
}

std::vector<std::string> GeneratorNames(bool in_space, bool with_scale) {
  std::vector<std::string> names = {
      "translation x", "translation y", "rotation"};
  if (in_space) {
    names = {"translation x",
             "translation y",
             "translation z",
             "rotation about x",
             "rotation about y",
             "rotation about z"};
  }
  if (with_scale) names.emplace_back("scale");
  return names;
}

Vector3d Center(const PoseScene& scene) {
  Vector3d center = Vector3d::Zero();
  for (const PoseScene::Point& point : scene.points) center += point.place;
  if (!scene.points.empty()) {
    center /= static_cast<double>(scene.points.size());
  }
  return center;
}

// The fields about the centre c of the points:
//   X -> X + a + delta x (X - c) + e (X - c)
// and, for X_camera = R X + t,  t -> t - R a + R (delta x c) + e (t + R c).
// left: rotations are from the body to the world, not from world to camera.
void Move(const PoseScene& scene,
          const std::vector<int>& generator_rows,
          bool left,
          MatrixXd* motions) {
  const Vector3d center = Center(scene);
  for (std::size_t g = 0; g < generator_rows.size(); ++g) {
    const MotionField field = MotionField::Unit(generator_rows[g]);
    const Vector3d a = field.head<3>();
    const Vector3d delta = field.segment<3>(3);
    const double e = field[6];
    double* motion = motions->col(static_cast<Index>(g)).data();
    for (const PoseScene::Point& point : scene.points) {
      const Vector3d p = point.place - center;
      const Vector3d change = a + delta.cross(p) + e * p;
      for (std::size_t i = 0; i < point.offsets.size(); ++i) {
        motion[point.offsets[i]] = change[static_cast<Index>(i)];
      }
    }
    for (const Turn& turn : scene.turns) {
      turn.Move(left ? delta : Vector3d(-delta), left, motion + turn.offset);
    }
    for (const PoseScene::Camera& camera : scene.cameras) {
      const auto& [R, t, offset, block] = camera;
      Eigen::Map<Vector3d>{motion + offset} =
          R * (delta.cross(center) - a) + e * (t + R * center);
    }
  }
}

// The points, and the cameras' centres.
std::vector<Landmark> Landmarks(const GaugeComponent& component,
                                const PoseScene& scene) {
  std::vector<Landmark> landmarks;
  landmarks.reserve(scene.points.size() + scene.cameras.size());
  for (const PoseScene::Point& point : scene.points) {
    Landmark landmark{point.place, {}};
    for (const int b : point.blocks) {
      landmark.blocks.push_back(&component.blocks[b]);
    }
    landmarks.push_back(std::move(landmark));
  }
  for (const auto& [R, t, offset, block] : scene.cameras) {
    landmarks.push_back({-R.transpose() * t, {&component.blocks[block]}});
  }
  return landmarks;
}

template <typename Layout>
Gauge MakeGauge(bool in_space,
                bool with_scale,
                bool left,
                const Layout& layout) {
  const std::vector<int> rows = GeneratorRows(in_space, with_scale);
  Gauge gauge;
  gauge.name = fmt::format("{} in {}",
                           with_scale ? "similarity" : "rigid motion",
                           in_space ? "space" : "the plane");
  gauge.generators = GeneratorNames(in_space, with_scale);
  gauge.motions = [=](const GaugeComponent& component, MatrixXd* motions) {
    PoseScene scene;
    if (!ReadScene(component, layout, &scene) ||
        (scene.points.empty() && scene.cameras.empty())) {
      return false;
    }
    Move(scene, rows, left, motions);
    return true;
  };
  gauge.name_combinations = [=](const GaugeComponent& component,
                                const MatrixXd& coefficients) {
    PoseScene scene;
    std::vector<Gauge::Combination> combinations;
    if (!ReadScene(component, layout, &scene)) return combinations;
    MatrixXd fields = MatrixXd::Zero(7, coefficients.cols());
    fields(rows, Eigen::all) = coefficients;
    for (NamedField& named : NameFields(
             fields, Landmarks(component, scene), Center(scene), in_space)) {
      combinations.push_back({std::move(named.name), named.field(rows)});
    }
    return combinations;
  };
  return gauge;
}

}  // namespace

Gauge PoseGauge(bool with_scale, const PlanarLayout& layout) {
  return MakeGauge(false, with_scale, /*left=*/true, layout);
}

Gauge PoseGauge(bool with_scale, const SpatialLayout& layout) {
  return MakeGauge(true, with_scale, /*left=*/!layout.is_camera, layout);
}

}  // namespace invgrad
