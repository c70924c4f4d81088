// Start values of poses and landmarks that have none, along the edges.
//
//   X_to = X_from P_from Z P_to^-1      an edge between poses
//   l = X_from P_from z                 an edge to a landmark
//   X_from = Z P_from^-1                a prior
//
// A spanning tree, by the algorithm of Dijkstra: from the poses that have
// values along the fewest edges, of which those with semidefinite information,
// which know a pose in part only, are the last choice. Where no pose has a
// value and no prior gives one, the first pose starts at the origin.
//
// Cost:    linear in the number of edges, up to a logarithm.
// Fails:   never; numbers may overflow.
#ifndef PROBLEMS_ESTIMATION_POSE_GRAPH_START_H_
#define PROBLEMS_ESTIMATION_POSE_GRAPH_START_H_

#include "problems/estimation/g2o_file.h"

namespace invgrad {

// Sets the last graph->num_poses_by_edges poses and the last
// graph->num_landmarks_by_edges landmarks.
void StartAlongEdges(PoseGraph* graph);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_POSE_GRAPH_START_H_
