// Gauge freedoms: motions of all parameter blocks together that leave the
// residuals between the blocks unchanged.
//
//   x_b -> x_b + e v_b(x),   each ambient motion v is a generator
//
// such as translations and rotations of a pose graph without anchor. A Gauge
// proposes motions for blocks of one layout; the rank report tests them by J v,
// so a wrong layout is harmless.
//
// The layouts that BuiltInGauges() covers:
//   blocks of one size         translation, one generator a component
//   (x, y, angle)              in the plane: translation, rotation, scale; as
//                              blocks of size 3, or of sizes 2 (a position) and
//                              1 (an angle), or of three blocks of size 1 that
//                              follow each other in the cost functions
//   position, rotation         in space, the body's pose in the world: blocks
//                              of sizes 3 and 4, or one of size 7 (6 with an
//                              angle axis), in either order
//   rotation, translation      in space, from the world to the camera, with
//                              world points of size 3: blocks of size 4 and 3
//                              next to each other in the cost functions, or one
//                              of size 7, or of size 6 and more that begins
//                              with an angle axis and a translation (BAL: 9)
//   a b                        the common factor of a group of blocks, and the
//                              factor between the first and second arguments of
//                              a product; for products of the components of
//                              blocks of one size, 2 to 8, a factor a component
// Blocks of other sizes do not move. Blocks of sizes 1 to 3 beside poses may be
// positions or calibrations; both are tested. Quaternions are (w, x, y, z) or
// (x, y, z, w), according to their ceres::Manifold; for other manifolds both
// orders are tested.
//
// Fails:   a Gauge returns false if the blocks do not have its layout.
//
// [1] Triggs, McLauchlan, Hartley, Fitzgibbon. Bundle Adjustment: A Modern
//     Synthesis. 1999, section 9 (gauge freedom).
#ifndef INVGRAD_GAUGE_H_
#define INVGRAD_GAUGE_H_

#include <functional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/manifold.h"

namespace invgrad {

struct GaugeBlock {
  const double* values = nullptr;
  int size = 0;      // ambient
  int offset = 0;    // of its entries in a motion
  std::string name;  // in the report; empty for a constant block without one
  const ceres::Manifold* manifold = nullptr;  // null: Euclidean
};

// Blocks that residuals couple, and then the other blocks of these residuals,
// such as constant ones, whose motion is ignored.
struct GaugeComponent {
  std::vector<GaugeBlock> blocks;
  int ambient_size = 0;  // the sum of the blocks' sizes
  // One a residual block: indices into blocks.
  std::vector<std::vector<int>> arguments;
};

struct Gauge {
  std::string name;                     // "rigid motion in the plane"
  std::vector<std::string> generators;  // "translation x", ...
  // Fills the motions: ambient_size x number of generators, zero on entry.
  // False if the blocks do not have this gauge's layout.
  std::function<bool(const GaugeComponent&, Eigen::MatrixXd* motions)> motions;

  struct Combination {
    std::string name;              // "rotation about `pose 0`"
    Eigen::VectorXd coefficients;  // of the generators
  };
  // Optional. Names combinations of the generators in the span of the columns of
  // `coefficients`, which are independent. It is needed if residuals determine a
  // part of the gauge only, such as the position of a pose. Without it the report
  // names single generators.
  std::function<std::vector<Combination>(const GaugeComponent&,
                                         const Eigen::MatrixXd& coefficients)>
      name_combinations = nullptr;
};

// Of equally good gauges, the first one is the simplest.
std::vector<Gauge> BuiltInGauges();

}  // namespace invgrad

#endif  // INVGRAD_GAUGE_H_
