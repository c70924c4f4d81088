// Finds parameters, and combinations of parameters, that the residuals of a
// ceres::Problem do not determine. Use it when solves from different starts end
// at the same cost with different parameters, or to decide what to hold
// constant. covariance.h says how exactly the residuals determine the other
// parameters. determined_step.h makes steps that leave undetermined directions
// alone. A Gauge names motions that the report looks for; write one only if
// those of BuiltInGauges do not suffice.
//
//   A = J D^-1,   D = diag(|J e_i|),   A = U diag(s) V^T:
//   undetermined  s <= threshold s_max       the motions D^-1 v leave r
//                                            unchanged
//   weak          s <= weak_threshold s_max  they change r by s / s_max only
//
// J is the Jacobian of ProblemLinearizer, at the current values, in tangent
// directions of the non-constant blocks. Its columns are scaled to length one,
// so that the result does not depend on the units of the parameters. Columns of
// zeros are reported first: no residual depends on these parameters. So are
// columns of rounding errors, which are 1e-13 of another one of their block, as
// is their effect |J e_i| |x_i|, and each entry of another one of its row.
// Where all values of a block are zero, none of its columns is. Directions that
// are no component, such as rotations, are judged by |J e_i| alone.
//
// A column that holds nothing but noise of measured derivatives is scaled to
// length one, too. Where parameters of a block have one unit and one coordinate
// frame, such as a position, Options::group_sizes gives them one scale:
//   D_i^2 = mean of |J e_j|^2 over the group of i
//
// Undetermined directions are reported in a readable basis: those within one
// block, those that touch few blocks, gauge freedoms by name (Gauge), and then
// the rest. For every group of blocks that residuals couple, the report
// suggests parameters to hold constant.
//
// Cost:    one decomposition per group: QR and SVD if it is dense
//          (max_dense_size), otherwise a sparse Cholesky decomposition and
//          subspace iteration (smallest_singular.h).
// Fails:   returns false, with a message, if an option is out of range, a cost
//          function fails or is not finite (the message names its residual
//          block), memory does not suffice or a decomposition fails.
// Limits:  the rank refers to the current values: symmetric values may lower
//          it, rounding errors may raise it. Singular values below about 1e-9
//          s_max are not resolved.
//
// Compared with Ceres: ceres::Covariance with DENSE_SVD fails with "rank
// deficient" if the smallest singular value of J itself is below 1e-7 of the
// largest one (its min_reciprocal_condition_number of 1e-14 is the square).
// With SPARSE_QR, its default, it detects exact deficiencies only.
#ifndef INVGRAD_RANK_REPORT_H_
#define INVGRAD_RANK_REPORT_H_

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/evaluation_callback.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"

namespace invgrad {

// A block as a Gauge sees it.
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
// positions or calibrations; both are tested, for all blocks of a size at once.
// So write a Gauge where a problem has both in one size. Quaternions are (w, x, y, z) or
// (x, y, z, w), according to their ceres::Manifold; for other manifolds both
// orders are tested.
//
// Fails:   a Gauge returns false if the blocks do not have its layout.
//
// [1] Triggs, McLauchlan, Hartley, Fitzgibbon. Bundle Adjustment: A Modern
//     Synthesis. 1999, section 9 (gauge freedom).
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
  // Optional. Names combinations of the generators in the span of the columns
  // of `coefficients`, which are independent. It is needed if residuals
  // determine a part of the gauge only, such as the position of a pose. Without
  // it the report names single generators.
  std::function<std::vector<Combination>(const GaugeComponent&,
                                         const Eigen::MatrixXd& coefficients)>
      name_combinations = nullptr;
};

// Of equally good gauges, the first one is the simplest.
std::vector<Gauge> BuiltInGauges();

struct RankReport {
  struct Options {
    double threshold = 1e-7;       // in (1e-12, 1)
    double weak_threshold = 1e-4;  // in [threshold, 1)
    // The approximate number of directions to search for in a group that is not
    // dense.
    int max_directions = 100;
    // A group is dense if it has up to so many parameters, and up to 4e7 rows x
    // parameters (320 MB).
    int max_dense_size = 1000;
    // Applies the robust losses to r and J, as the solver does.
    bool apply_loss_function = true;
    // The name of a block; "" or no function: "block i". i counts the
    // non-constant blocks in the order in which the residual blocks first use
    // them. Constant blocks need names only where a gauge is named by them:
    // "rotation about `pose 0`".
    std::function<std::string(const double* values)> block_name;
    // The sizes of the groups of tangent directions of a block that have one
    // unit and one coordinate frame, as in determined_step.h: {3} for a
    // position. Empty or no function: groups of one.
    std::function<std::vector<int>(const double* values)> group_sizes;
    // Tried before the built-in ones.
    std::vector<Gauge> gauges;
    bool look_for_built_in_gauges = true;
    // The evaluation callback of the problem, if any. Not owned.
    ceres::EvaluationCallback* evaluation_callback = nullptr;

    bool IsValid(std::string* error) const;
  };

  // A block that is not constant.
  struct Block {
    const double* values = nullptr;
    std::string name;
    int size = 0;          // ambient
    int tangent_size = 0;  // its number of columns of J
    int column = 0;        // the first of them
    int group = -1;        // -1: unused
    // The component of each tangent direction; -1 if there is none, as for
    // rotations.
    std::vector<int> components;

    // "`pose 0`[2]", or "`pose 0` tangent 1" if that is not a component.
    std::string ParameterName(int tangent) const;
  };

  struct Part {
    int block = 0;
    double share = 0.0;  // of |v|^2; the shares of a direction add up to 1
    // The block's tangent_size entries of D^-1 v, in the parameters' units,
    // scaled so that the direction's largest entry is 1.
    Eigen::VectorXd motion;
  };

  struct Direction {
    double singular_value = 0.0;  // |A v| / s_max for |v| = 1
    std::vector<Part> parts;      // the largest share first
    int group = 0;
    std::string gauge;  // a gauge freedom's name, or empty
    // "translation x", "rotation about `pose 0`"; empty: no gauge, or a
    // combination of its generators without a name.
    std::string generator;
  };

  // Parameters that no residual depends on.
  struct Unused {
    int block = 0;
    bool whole_block = false;
    bool in_no_residual = false;  // no residual block names the block
    bool has_rounding = false;    // derivatives that are rounding errors
    std::vector<int> tangent;     // directions of the block
  };

  // The column of one of three parameters that is much shorter than the others
  // of its block, at most 0.02 of them.
  struct ShortColumn {
    int block = 0;
    int tangent = 0;
    double relative_length = 0.0;  // to the shorter one of the others
  };

  // Two parameters of a group with the same value, not zero, and parallel columns
  // of J. If they are two of a kind, such as the rates of two decays, J has lost
  // rank only there, and they need different start values.
  struct EqualParameters {
    std::array<int, 2> blocks = {0, 0};
    std::array<int, 2> tangents = {0, 0};  // directions of the blocks
    double value = 0.0;
  };

  // A gauge freedom of a group.
  struct GaugeFreedom {
    int group = 0;
    std::string name;
    int num_generators = 0;
    std::vector<int> directions;  // indices of `undetermined`
  };

  // Parameters to hold constant, or to give a prior.
  struct Suggestion {
    int group = 0;
    int block = 0;
    bool whole_block = false;
    std::vector<int> tangent;  // directions of the block
    int num_removed = 0;       // undetermined directions
  };

  double cost = 0.0;  // L, at the current values
  int num_residuals = 0;
  int num_parameters = 0;  // tangent, of the blocks that are not constant
  int num_constant_blocks = 0;
  int num_groups = 0;
  // The number of s > threshold s_max. An upper bound if not is_complete.
  int rank = 0;
  bool is_complete = true;
  double s_max = 0.0;  // of A
  double threshold = 0.0;
  double weak_threshold = 0.0;
  // s / s_max of A, ascending: one value per parameter if all groups are small,
  // otherwise the values found. Unused parameters have 0.
  Eigen::VectorXd singular_values;
  bool has_all_singular_values = false;
  // The same of J itself, if all groups are small; otherwise empty.
  Eigen::VectorXd unscaled_singular_values;
  // The smallest and largest length of a nonzero column of J.
  double shortest_column = 0.0;
  double longest_column = 0.0;

  std::vector<Block> blocks;
  std::vector<Unused> unused;
  std::vector<ShortColumn> short_columns;  // of blocks without group_sizes
  std::vector<Direction> undetermined;     // without the unused parameters
  std::vector<Direction> weak;
  std::vector<EqualParameters> equal_parameters;
  std::vector<GaugeFreedom> gauges;
  std::vector<Suggestion> suggestions;

  int num_undetermined() const { return num_parameters - rank; }

  // The motions of a direction's parts as one step, of size num_parameters.
  Eigen::VectorXd Step(const Direction& direction) const;

  // The report as text. Lists of blocks and directions end after max_items.
  std::string ToText(int max_items = 10) const;
};

bool ComputeRankReport(const RankReport::Options& options,
                       const ceres::Problem& problem,
                       RankReport* report,
                       std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_RANK_REPORT_H_
