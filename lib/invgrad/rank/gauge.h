// Gauge freedoms: motions of all parameter blocks together that residuals
// between the blocks cannot see.
//
//   x_b -> x_b + e v_b(x),   one ambient motion v a generator
//
// A pose graph without anchor may be translated and turned as a whole, a
// reconstruction from images scaled as well. A Gauge knows such motions for
// blocks of a given layout; whether the residuals are blind to them is tested
// by J v, so a layout that is guessed wrongly does no harm.
//
// The layouts that BuiltInGauges() knows:
//   blocks of one size         translation, one generator a component
//   (x, y, angle)              in the plane: translation, rotation, scale; as
//                              blocks of size 3, or of sizes 2 (a position) and
//                              1 (an angle), or of three blocks of size 1 that
//                              follow each other in the cost functions
//   position, rotation         in space, the body's pose in the world: blocks
//   of
//                              sizes 3 and 4, or one of size 7 (6 with an angle
//                              axis), in either order
//   rotation, translation      in space, from the world to the camera, with
//                              world points of size 3: blocks of size 4 and 3
//                              next to each other in the cost functions, or one
//                              of size 7, or of size 6 and more that begins
//                              with an angle axis and a translation (BAL: 9)
//   a b                        the common factor of a group of blocks, and the
//                              factor that a product leaves open between first
//                              and second arguments
// Blocks of sizes that are left over do not move; those of sizes 1 to 3 beside
// poses are tried both ways, as positions and as calibrations.
// Quaternions are (w, x, y, z) or (x, y, z, w): by their ceres::Manifold if
// that is a block's own, otherwise both are tried.
//
// Fails:   a Gauge that does not fit the blocks says so; nothing else.
//
// [1] Triggs, McLauchlan, Hartley, Fitzgibbon. Bundle Adjustment: A Modern
//     Synthesis. 1999, section 9 (gauge freedom).
#ifndef INVGRAD_RANK_GAUGE_H_
#define INVGRAD_RANK_GAUGE_H_

#include <functional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/manifold.h"

namespace invgrad {

struct GaugeBlock {
  const double* values = nullptr;
  int size = 0;    // ambient
  int offset = 0;  // of its entries in a motion
  bool is_constant = false;
  const ceres::Manifold* manifold = nullptr;  // null: Euclidean
};

// Blocks that residuals tie together, and the constant blocks beside them,
// whose motion is ignored.
struct GaugeComponent {
  std::vector<GaugeBlock> blocks;
  int ambient_size = 0;  // the sum of the blocks' sizes
  // One a residual block: indices into blocks.
  std::vector<std::vector<int>> arguments;
};

struct Gauge {
  std::string name;                     // "rigid motion in the plane"
  std::vector<std::string> generators;  // "translation x", ...
  // The motions: ambient_size x number of generators, which comes zeroed.
  // False if the blocks are not laid out for this gauge.
  std::function<bool(const GaugeComponent&, Eigen::MatrixXd* motions)> motions;
};

// From few generators to many, so that the first of those that explain the most
// is the simplest.
std::vector<Gauge> BuiltInGauges();

}  // namespace invgrad

#endif  // INVGRAD_RANK_GAUGE_H_
