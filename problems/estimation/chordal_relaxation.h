// The poses of a graph by two linear problems: rotations, whose matrices need
// not be rotations at first, then positions.
//
//   min sum_ij w_ij |R_i Z_ij - R_j|^2         over d x d matrices R
//   R_i <- the rotation that is nearest to R_i
//   min sum_ij u_ij |t_i + R_i z_ij - t_j|^2   over positions t
//
// Z_ij, z_ij: rotation and translation of an edge between poses; priors are
// edges from the world. w and u: the mean of the information of rotations and
// of translations. A landmark is the mean of where its poses see it. Poses that
// are constant in the problem (pose_graph.h) stay.
//
// It needs no start, and its result is close to the least cost if the rotations
// are known well, from any start: use it where a local method may end in a
// local minimum.
//
// Cost:    two sparse Cholesky decompositions, with d N and N columns for N
//          poses.
// Fails:   returns false, and leaves the poses unchanged, if the edges with
//          w > 0, or those with u > 0, do not connect all poses with a constant
//          one or a prior, or if a number is not finite.
// Source:  Carlone, Tron, Daniilidis, Dellaert. Initialization techniques for
//          3D SLAM. ICRA 2015, section III-B (rotations, first proposed by
//          Martinez et al., 2010).
#ifndef PROBLEMS_ESTIMATION_CHORDAL_RELAXATION_H_
#define PROBLEMS_ESTIMATION_CHORDAL_RELAXATION_H_

#include "problems/estimation/g2o_file.h"

namespace invgrad {

bool RelaxChordally(PoseGraph* graph);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_CHORDAL_RELAXATION_H_
