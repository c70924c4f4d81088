#include <map>
#include <string>
#include <vector>

#include "invgrad/rank/pose_gauges.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;

// Blocks of sizes 1 and 2 may also be calibrations, which do not move.
struct PlanarLayout {
  bool blocks_of_one_are_angles;
  bool blocks_of_two_are_points;
  bool split;  // x, y and angle are blocks of their own
};

struct PlanarScene {
  struct Point {
    Vector2d place;
    int x_offset;
    int y_offset;
  };
  std::vector<Point> points;
  std::vector<int> angles;  // offsets
};

// Arguments of the cost functions in threes. False if they are none.
bool ReadSplitPoses(const GaugeComponent& component, PlanarScene* scene) {
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
      if (role == 2) scene->angles.push_back(block.offset);
      if (role != 0) continue;
      const GaugeBlock& y = component.blocks[arguments[i + 1]];
      scene->points.push_back(
          {{*block.values, *y.values}, block.offset, y.offset});
    }
  }
  return true;
}

void ReadPoses(const GaugeComponent& component,
               const PlanarLayout& layout,
               PlanarScene* scene) {
  for (const GaugeBlock& block : component.blocks) {
    if (block.size == 3 ||
        (block.size == 2 && layout.blocks_of_two_are_points)) {
      scene->points.push_back(
          {{block.values[0], block.values[1]}, block.offset, block.offset + 1});
    }
    if (block.size == 3) scene->angles.push_back(block.offset + 2);
    if (block.size == 1 && layout.blocks_of_one_are_angles) {
      scene->angles.push_back(block.offset);
    }
  }
}

// The generators about the centre of the points.
bool PlanarMotions(const GaugeComponent& component,
                   const PlanarLayout& layout,
                   MatrixXd* motions) {
  PlanarScene scene;
  if (layout.split) {
    if (!ReadSplitPoses(component, &scene)) return false;
  } else {
    ReadPoses(component, layout, &scene);
  }
  if (scene.points.empty()) return false;
  Vector2d center = Vector2d::Zero();
  for (const PlanarScene::Point& point : scene.points) center += point.place;
  center /= static_cast<double>(scene.points.size());
  for (const PlanarScene::Point& point : scene.points) {
    const Vector2d r = point.place - center;
    auto x = motions->row(point.x_offset);
    auto y = motions->row(point.y_offset);
    x[0] = 1.0;
    y[1] = 1.0;
    x[2] = -r[1];
    y[2] = r[0];
    if (motions->cols() > 3) {
      x[3] = r[0];
      y[3] = r[1];
    }
  }
  for (const int offset : scene.angles) (*motions)(offset, 2) = 1.0;
  return true;
}

}  // namespace

std::vector<Gauge> PlanarGauges(bool with_scale) {
  std::vector<std::string> generators = {
      "translation x", "translation y", "rotation"};
  if (with_scale) generators.push_back("scale");
  std::vector<Gauge> gauges;
  for (const PlanarLayout layout : {PlanarLayout{false, true, false},
                                    PlanarLayout{true, true, false},
                                    PlanarLayout{false, false, false},
                                    PlanarLayout{true, false, false},
                                    PlanarLayout{false, false, true}}) {
    gauges.push_back(
        {with_scale ? "similarity in the plane" : "rigid motion in the plane",
         generators,
         [layout](const GaugeComponent& component, MatrixXd* motions) {
           return PlanarMotions(component, layout, motions);
         }});
  }
  return gauges;
}

}  // namespace invgrad
