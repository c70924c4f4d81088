// The optimization of a pose graph as a ceres::Problem.
//
//   residual = W e, W^T W = the information (information.h), so that
//   |residual|^2 = e^T information e, with g2o's error [1]:
//
//   between poses   e = Coordinates((P_a Z)^-1 X_a^-1 X_b P_b)    (motion.h)
//   a prior         e = Coordinates(Z^-1 X_a P_a)
//   a landmark      e = (X_a P_a)^-1 l - z
//
// X: poses, P: the poses of sensors on them, Z, z: measurements. The
// information is in the frame of the measurement. A rotation's error is its
// angle in [-pi, pi), or in 3D vec(q), half of a small angle.
//
// Ceres' examples [2] have, between poses, another error:
//
//   e = [R_a^T (p_b - p_a) - p_ab; theta_b - theta_a - theta_ab]
//   3D   2 vec(q_ab (q_a^-1 q_b)^-1) in place of the angles
//
// Its information is in the frame of pose a, and W is the lower Cholesky factor,
// L of L L^T, which gives another cost unless the information is diagonal.
// Ceres' published costs are for this error and this factor.
//
// Parameter blocks are in the columns of graph->poses and graph->landmarks,
// which must outlive the problem and not move: in 2D one of 3 (x, y, theta),
// whose angle stays in [-pi, pi); in 3D one of 3 and one of 4, a unit quaternion
// x y z w; of a landmark one of 2 or 3. Constant is what FIX lines name, or,
// without such lines and without priors, the first pose.
// Cost:    one Jet of up to 14 derivatives an edge.
//
// [1] https://github.com/RainerKuemmerle/g2o, g2o/types/slam2d and slam3d.
// [2] Ceres Solver 2.1, examples/slam/pose_graph_2d and pose_graph_3d.
#ifndef PROBLEMS_ESTIMATION_POSE_GRAPH_H_
#define PROBLEMS_ESTIMATION_POSE_GRAPH_H_

#include <string>
#include <vector>

#include "ceres/cost_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "invgrad/random.h"
#include "problems/estimation/g2o_file.h"
#include "problems/estimation/motion.h"
#include "problems/estimation/robust_loss.h"

namespace invgrad {

enum class EdgeError {
  kG2o,
  kCeres,       // Ceres' error and Cholesky factor
  kCeresUpper,  // Ceres' error and the upper Cholesky factor
};

// The pose of a sensor; the identity if the index is -1.
template <int kDimension>
Motion<double, kDimension> OffsetMotion(const PoseGraph& graph, int index) {
  if (index < 0) return Motion<double, kDimension>::Identity();
  return ToMotion<kDimension>(graph.offsets[index].pose.data());
}

// Returns false, with *error set, if the graph has edges that the error does
// not define: other than between poses, or, with the lower factor, of
// semidefinite information.
bool HasEdgeError(const PoseGraph& graph,
                  EdgeError edge_error,
                  std::string* error);

// Parameter blocks: those of pose a, and of pose b or of the landmark. CHECKs
// that the error is defined. The caller owns it.
ceres::CostFunction* MakeEdgeError(const PoseGraph& graph,
                                   EdgeError edge_error,
                                   const PoseGraph::Edge& edge);

// The columns of the poses that are constant.
std::vector<int> ConstantPoses(const PoseGraph& graph);

// The manifold of (x, y, theta). The caller owns it.
ceres::Manifold* MakePoseManifold2d();

// One loss function an edge, owned by the problem.
void AddPoseGraph(EdgeError edge_error,
                  const MakeLossFunction& make_loss,
                  PoseGraph* graph,
                  ceres::Problem* problem);

// Noise of standard deviation `sigma` on what is not constant: on positions in
// their unit, on orientations in radians.
void PerturbPoseGraph(double sigma, NumpyRandom* random, PoseGraph* graph);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_POSE_GRAPH_H_
