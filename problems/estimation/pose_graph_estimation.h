// Pose graphs (pose_graph.h) as an Estimation.
#ifndef PROBLEMS_ESTIMATION_POSE_GRAPH_ESTIMATION_H_
#define PROBLEMS_ESTIMATION_POSE_GRAPH_ESTIMATION_H_

#include <memory>
#include <string>

#include "problems/estimation/estimation.h"
#include "problems/estimation/pose_graph.h"

namespace invgrad {

// Returns null, with *error set, if the file cannot be read.
std::unique_ptr<Estimation> ReadPoseGraphEstimation(const std::string& path,
                                                    InformationRoot root,
                                                    std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_POSE_GRAPH_ESTIMATION_H_
