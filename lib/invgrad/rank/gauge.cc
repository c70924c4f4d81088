#include "invgrad/rank/gauge.h"

#include <map>
#include <utility>

#include "fmt/core.h"
#include "invgrad/rank/pose_gauges.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
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

}  // namespace

std::vector<Gauge> BuiltInGauges() {
  std::vector<Gauge> gauges = {
      {"factor between first and second arguments, of which the residuals see "
       "only products",
       {"factor"},
       FactorOfProduct},
      {"common factor of all blocks", {"scale"}, CommonFactor}};
  // Larger blocks are rarely positions.
  constexpr int kLargestPlace = 3;
  for (int size = 1; size <= kLargestPlace; ++size) {
    gauges.push_back(Translation(size));
  }
  for (const bool with_scale : {false, true}) {
    for (const auto& make : {PlanarGauges, SpatialGauges}) {
      for (Gauge& gauge : make(with_scale)) gauges.push_back(std::move(gauge));
    }
  }
  return gauges;
}

}  // namespace invgrad
