#include "fmt/core.h"
#include "invgrad/rank/pose_gauge.h"
#include "invgrad/rank_report.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

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
    motions->col(0).segment(block.offset, block.size) =
        Eigen::Map<const VectorXd>(block.values, block.size);
  }
  return component.blocks.size() > 1;
}

// Multiplies blocks that are first arguments by a factor, and divides second
// arguments by it: one factor for all components (one column), or one for each
// component of blocks of one size. Single arguments are priors.
bool FactorsOfProduct(const GaugeComponent& component, MatrixXd* motions) {
  const auto num_factors = static_cast<int>(motions->cols());
  std::vector<int> places(component.blocks.size(), -1);  // -1: not in a pair
  bool has_pairs = false;
  for (const std::vector<int>& arguments : component.arguments) {
    if (arguments.size() == 1) continue;
    if (arguments.size() != 2) return false;
    has_pairs = true;
    for (int place = 0; place < 2; ++place) {
      const int b = arguments[place];
      if (num_factors > 1 && component.blocks[b].size != num_factors) {
        return false;
      }
      if (places[b] >= 0 && places[b] != place) return false;
      places[b] = place;
    }
  }
  for (std::size_t b = 0; b < places.size(); ++b) {
    if (places[b] < 0) continue;
    const GaugeBlock& block = component.blocks[b];
    for (int i = 0; i < block.size; ++i) {
      (*motions)(block.offset + i, num_factors == 1 ? 0 : i) =
          places[b] == 0 ? block.values[i] : -block.values[i];
    }
  }
  return has_pairs;
}

Gauge ComponentFactors(int size) {
  Gauge gauge;
  gauge.name =
      "factors between the components of first and second arguments, of which "
      "the residuals see only products";
  for (int i = 0; i < size; ++i) {
    gauge.generators.push_back(fmt::format("factor of component {}", i));
  }
  gauge.motions = FactorsOfProduct;
  return gauge;
}

}  // namespace

std::vector<Gauge> BuiltInGauges() {
  std::vector<Gauge> gauges = {
      {"factor between first and second arguments, of which the residuals see "
       "only products",
       {"factor"},
       FactorsOfProduct},
      {"common factor of all blocks", {"scale"}, CommonFactor}};
  // Larger blocks are rarely positions.
  for (int size = 1; size <= 3; ++size) {
    gauges.push_back(Translation(size));
  }
  for (const bool with_scale : {false, true}) {
    // All combinations; the fifth layout in the plane is that of split poses.
    for (int i = 0; i < 5; ++i) {
      const PlanarLayout layout = {i % 2 == 1, i < 2, i == 4};
      gauges.push_back(PoseGauge(with_scale, layout));
    }
    for (int i = 0; i < 24; ++i) {
      const Rotation kinds[] = {
          Rotation::kWxyz, Rotation::kXyzw, Rotation::kAngleAxis};
      const SpatialLayout layout = {
          i / 6 % 2 == 1, kinds[i / 2 % 3], i % 2 == 0, i < 12};
      gauges.push_back(PoseGauge(with_scale, layout));
    }
  }
  // As the channels of colours.
  for (int size = 2; size <= 8; ++size)
    gauges.push_back(ComponentFactors(size));
  return gauges;
}

}  // namespace invgrad
