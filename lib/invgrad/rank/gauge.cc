#include "invgrad/rank/gauge.h"

#include <cmath>
#include <map>
#include <set>
#include <type_traits>
#include <utility>

#include "Eigen/Geometry"
#include "fmt/core.h"

namespace invgrad {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using Eigen::VectorXd;

Eigen::Map<const VectorXd> Values(const GaugeBlock& block) {
  return {block.values, block.size};
}

Gauge Translation(int size) {
  Gauge gauge;
  gauge.name = fmt::format("common translation of the blocks of size {}", size);
  for (int i = 0; i < size; ++i) {
    gauge.generators.push_back(
        size == 1 ? "translation"
                  : fmt::format("translation of component {}", i));
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
bool CommonFactor(const GaugeComponent& component, MatrixXd* motions) {
  for (const GaugeBlock& block : component.blocks) {
    motions->col(0).segment(block.offset, block.size) = Values(block);
  }
  return component.blocks.size() > 1;
}

// Multiplies blocks that are first arguments by a factor, and divides second
// arguments by it.
bool FactorOfProduct(const GaugeComponent& component, MatrixXd* motions) {
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
        (place == 0 ? 1.0 : -1.0) * Values(block);
  }
  return true;
}

// Of poses in the plane (z = 0, rotations about z) and in space.
enum class Rotation { kAngle, kAngleAxis, kWxyz, kXyzw };

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

// Rotating values of a block.
struct Turn {
  Rotation kind;
  const double* values;
  int offset;  // in a motion

  Quaterniond Quaternion() const {
    if (kind == Rotation::kWxyz) {
      return {values[0], values[1], values[2], values[3]};
    }
    return Quaterniond(values);
  }

  // Of a rotation in space.
  Matrix3d Matrix() const {
    if (kind != Rotation::kAngleAxis) {
      return Quaternion().normalized().toRotationMatrix();
    }
    const Vector3d phi(values);
    return Eigen::AngleAxisd(phi.norm(), phi.normalized()).toRotationMatrix();
  }

  // The motion of the values for R -> exp(delta) R (left) or R exp(delta).
  void Move(const Vector3d& delta, bool left, double* motion) const {
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
};

// The spatial meaning of the blocks of a component.
struct Scene {
  struct Point {
    Vector3d place;
    std::vector<int> offsets;  // of its entries: x, y and in space z
  };
  struct Camera {
    Matrix3d R;
    Vector3d t;
    int offset;  // of t
  };
  std::vector<Point> points;    // p -> p + a + delta x p
  std::vector<Turn> turns;      // R -> exp(delta) R or R exp(-delta)
  std::vector<Camera> cameras;  // t follows R and the points
};

struct Generator {
  std::string name;
  Vector3d a = Vector3d::Zero();      // translation
  Vector3d delta = Vector3d::Zero();  // rotation
  double e = 0.0;                     // scale
};

std::vector<Generator> Generators(bool in_space, bool with_scale) {
  const char* const axes[] = {"x", "y", "z"};
  std::vector<Generator> generators;
  generators.reserve(7);
  for (int i = 0; i < (in_space ? 3 : 2); ++i) {
    generators.push_back(
        {fmt::format("translation {}", axes[i]), Vector3d::Unit(i)});
  }
  for (int i = in_space ? 0 : 2; i < 3; ++i) {
    generators.push_back(
        {in_space ? fmt::format("rotation about {}", axes[i]) : "rotation",
         Vector3d::Zero(),
         Vector3d::Unit(i)});
  }
  if (with_scale) {
    generators.push_back({"scale", Vector3d::Zero(), Vector3d::Zero(), 1.0});
  }
  return generators;
}

// The generators about the centre c of the points:
//   X -> X + a + delta x (X - c) + e (X - c)
// and, for X_camera = R X + t,  t -> t - R a + R (delta x c) + e (t + R c).
// left: rotations are from the body to the world, not from world to camera.
void Move(const Scene& scene,
          const std::vector<Generator>& generators,
          bool left,
          MatrixXd* motions) {
  Vector3d center = Vector3d::Zero();
  for (const Scene::Point& point : scene.points) center += point.place;
  if (!scene.points.empty()) {
    center /= static_cast<double>(scene.points.size());
  }
  for (std::size_t g = 0; g < generators.size(); ++g) {
    const auto& [name, a, delta, e] = generators[g];
    double* motion = motions->col(static_cast<Eigen::Index>(g)).data();
    for (const Scene::Point& point : scene.points) {
      const Vector3d p = point.place - center;
      const Vector3d change = a + delta.cross(p) + e * p;
      for (std::size_t i = 0; i < point.offsets.size(); ++i) {
        motion[point.offsets[i]] = change[static_cast<Eigen::Index>(i)];
      }
    }
    for (const Turn& turn : scene.turns) {
      turn.Move(left ? delta : Vector3d(-delta), left, motion + turn.offset);
    }
    for (const auto& [R, t, offset] : scene.cameras) {
      Put(R * (delta.cross(center) - a) + e * (t + R * center),
          motion + offset);
    }
  }
}

// The layout of poses in the plane. Blocks of sizes 1 and 2 may also be
// calibrations, which do not move.
struct PlanarLayout {
  bool blocks_of_one_are_angles;
  bool blocks_of_two_are_points;
  bool split;  // x, y and angle are blocks of their own
};

// Arguments of the cost functions in threes. False if they are none.
bool ReadSplitPoses(const GaugeComponent& component, Scene* scene) {
  std::map<int, int> roles;  // of blocks: 0, 1, 2 for x, y, angle
  for (const std::vector<int>& arguments : component.arguments) {
    if (arguments.size() % 3 != 0) return false;
    for (std::size_t i = 0; i < arguments.size(); ++i) {
      const int role = static_cast<int>(i % 3);
      const GaugeBlock& block = component.blocks[arguments[i]];
      if (block.size != 1) return false;
      const auto [it, is_new] = roles.insert({arguments[i], role});
      if (it->second != role) return false;
      if (is_new && role == 0) {
        const GaugeBlock& y = component.blocks[arguments[i + 1]];
        scene->points.push_back(
            {{*block.values, *y.values, 0.0}, {block.offset, y.offset}});
      } else if (is_new && role == 2) {
        scene->turns.push_back({Rotation::kAngle, block.values, block.offset});
      }
    }
  }
  return true;
}

// Interprets the blocks by a layout. False if they do not fit it.
bool Read(const GaugeComponent& component,
          const PlanarLayout& layout,
          Scene* scene) {
  if (layout.split) return ReadSplitPoses(component, scene);
  for (const GaugeBlock& block : component.blocks) {
    const double* x = block.values;
    if (block.size == 3 ||
        (block.size == 2 && layout.blocks_of_two_are_points)) {
      scene->points.push_back(
          {{x[0], x[1], 0.0}, {block.offset, block.offset + 1}});
    }
    if (block.size == 3 ||
        (block.size == 1 && layout.blocks_of_one_are_angles)) {
      const int last = block.size - 1;
      scene->turns.push_back({Rotation::kAngle, x + last, block.offset + last});
    }
  }
  return true;
}

// The layout of poses in space.
struct SpatialLayout {
  bool is_camera;  // from the world to the camera, or the body's in the world
  Rotation kind;
  bool rotation_first;  // before the position
  // Otherwise they are calibrations, which do not move.
  bool blocks_of_three_are_points;
};

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
      const Turn turn = {
          QuaternionOrder(rotation, layout.kind), rotation.values, 0};
      scene->cameras.push_back(
          {turn.Matrix(), Vector3d(translation.values), translation.offset});
    }
  }
  return true;
}

bool Read(const GaugeComponent& component,
          const SpatialLayout& layout,
          Scene* scene) {
  const bool has_quaternions = layout.kind != Rotation::kAngleAxis;
  const auto add_point = [scene](const double* x, int offset) {
    scene->points.push_back({Vector3d(x), {offset, offset + 1, offset + 2}});
  };
  std::set<int> translations;
  if (layout.is_camera && has_quaternions &&
      !ReadSplitCameras(component, layout, scene, &translations)) {
    return false;
  }
  for (std::size_t b = 0; b < component.blocks.size(); ++b) {
    const GaugeBlock& block = component.blocks[b];
    const double* x = block.values;
    if (block.size == 3) {
      if (layout.blocks_of_three_are_points &&
          translations.count(static_cast<int>(b)) == 0) {
        add_point(x, block.offset);
      }
    } else if (has_quaternions ? block.size == 7 : block.size >= 6) {
      const int rotation = layout.rotation_first ? 0 : 3;
      const int position = !layout.rotation_first ? 0 : has_quaternions ? 4 : 3;
      if (has_quaternions && !IsUnit(x + rotation)) return false;
      const Turn turn = {layout.kind, x + rotation, block.offset + rotation};
      scene->turns.push_back(turn);
      if (layout.is_camera) {
        scene->cameras.push_back(
            {turn.Matrix(), Vector3d(x + position), block.offset + position});
      } else {
        add_point(x + position, block.offset + position);
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

template <typename Layout>
Gauge PoseGauge(bool with_scale, bool left, const Layout& layout) {
  constexpr bool kInSpace = std::is_same_v<Layout, SpatialLayout>;
  const std::vector<Generator> generators = Generators(kInSpace, with_scale);
  Gauge gauge;
  gauge.name = fmt::format("{} in {}",
                           with_scale ? "similarity" : "rigid motion",
                           kInSpace ? "space" : "the plane");
  for (const Generator& generator : generators) {
    gauge.generators.push_back(generator.name);
  }
  gauge.motions = [=](const GaugeComponent& component, MatrixXd* motions) {
    Scene scene;
    if (!Read(component, layout, &scene) ||
        (scene.points.empty() && scene.cameras.empty())) {
      return false;
    }
    Move(scene, generators, left, motions);
    return true;
  };
  return gauge;
}

}  // namespace

std::vector<Gauge> BuiltInGauges() {
  std::vector<Gauge> gauges = {
      {"factor between first and second arguments, of which the residuals see "
       "only products",
       {"factor"},
       FactorOfProduct},
      {"common factor of all blocks", {"scale"}, CommonFactor}};
  // Larger blocks are rarely positions.
  for (int size = 1; size <= 3; ++size) {
    gauges.push_back(Translation(size));
  }
  for (const bool with_scale : {false, true}) {
    // All combinations; the fifth layout in the plane is that of split poses.
    for (int i = 0; i < 5; ++i) {
      const PlanarLayout layout = {i % 2 == 1, i < 2, i == 4};
      gauges.push_back(PoseGauge(with_scale, /*left=*/true, layout));
    }
    for (int i = 0; i < 24; ++i) {
      const Rotation kinds[] = {
          Rotation::kWxyz, Rotation::kXyzw, Rotation::kAngleAxis};
      const SpatialLayout layout = {
          i / 6 % 2 == 1, kinds[i / 2 % 3], i % 2 == 0, i < 12};
      gauges.push_back(PoseGauge(with_scale, !layout.is_camera, layout));
    }
  }
  return gauges;
}

}  // namespace invgrad
