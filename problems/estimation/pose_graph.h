// The optimization of a pose graph as a ceres::Problem.
//
//   residual = W [R_a^T (p_b - p_a) - p_ab; e]
//   2D   e = theta_b - theta_a - theta_ab, in [-pi, pi)
//   3D   e = 2 vec(q_ab (q_a^-1 q_b)^-1)
//
// W is a Cholesky factor of the information, L L^T: kUpper, W = L^T, follows
// the format: |residual|^2 = e^T information e. kLower, W = L, follows Ceres'
// examples [1], and is a different cost unless the information is diagonal. The
// published costs of Ceres are for kLower.
//
// Parameter blocks are in the columns of graph->poses, which must outlive the
// problem and not move: in 2D one of 3 (x, y, theta), whose angle stays in
// [-pi, pi); in 3D one of 3 and one of 4, a unit quaternion x y z w. The poses
// of FIX lines are constant, or the first pose if there are none.
// Cost:    one Jet of 6 or 14 derivatives an edge.
// Fails:   CHECKs that the information is positive definite.
//
// [1] Ceres Solver 2.1, examples/slam/pose_graph_2d and pose_graph_3d.
#ifndef PROBLEMS_ESTIMATION_POSE_GRAPH_H_
#define PROBLEMS_ESTIMATION_POSE_GRAPH_H_

#include "ceres/cost_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "invgrad/random.h"
#include "problems/estimation/g2o_file.h"
#include "problems/estimation/robust_loss.h"

namespace invgrad {

enum class InformationRoot { kLower, kUpper };

// Parameter blocks: pose a, pose b. The caller owns it.
ceres::CostFunction* MakePoseError2d(InformationRoot root,
                                     const PoseGraph::Edge& edge);
// Parameter blocks: p_a, q_a, p_b, q_b. The caller owns it.
ceres::CostFunction* MakePoseError3d(InformationRoot root,
                                     const PoseGraph::Edge& edge);

// The manifold of (x, y, theta). The caller owns it.
ceres::Manifold* MakePoseManifold2d();

// One loss function an edge, owned by the problem.
void AddPoseGraph(InformationRoot root,
                  const MakeLossFunction& make_loss,
                  PoseGraph* graph,
                  ceres::Problem* problem);

// Noise of standard deviation `sigma` on the poses that are not constant: on
// positions in their unit, on orientations in radians.
void PerturbPoseGraph(double sigma, NumpyRandom* random, PoseGraph* graph);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_POSE_GRAPH_H_
