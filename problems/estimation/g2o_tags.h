// The tags of g2o's text format, for its reader and its writer.
#ifndef PROBLEMS_ESTIMATION_G2O_TAGS_H_
#define PROBLEMS_ESTIMATION_G2O_TAGS_H_

#include "problems/estimation/g2o_file.h"

namespace invgrad {

struct G2oVertexTag {
  const char* name;
  int dimension;
  bool is_landmark;
};
constexpr G2oVertexTag kG2oVertexTags[] = {
    {"VERTEX_SE2", 2, false},
    {"VERTEX_SE3:QUAT", 3, false},
    {"VERTEX_XY", 2, true},
    {"VERTEX_TRACKXYZ", 3, true},
};

struct G2oEdgeTag {
  const char* name;
  int dimension;
  PoseGraph::EdgeKind kind;
  int num_offsets;  // ids of PARAMS_SE3OFFSET
};
constexpr G2oEdgeTag kG2oEdgeTags[] = {
    {"EDGE_SE2", 2, PoseGraph::EdgeKind::kRelative, 0},
    {"EDGE_PRIOR_SE2", 2, PoseGraph::EdgeKind::kPrior, 0},
    {"EDGE_SE2_XY", 2, PoseGraph::EdgeKind::kLandmark, 0},
    {"EDGE_SE3:QUAT", 3, PoseGraph::EdgeKind::kRelative, 0},
    {"EDGE_SE3_OFFSET", 3, PoseGraph::EdgeKind::kRelative, 2},
    {"EDGE_SE3_PRIOR", 3, PoseGraph::EdgeKind::kPrior, 1},
    {"EDGE_SE3_TRACKXYZ", 3, PoseGraph::EdgeKind::kLandmark, 1},
};

constexpr char kG2oOffsetTag[] = "PARAMS_SE3OFFSET";
constexpr char kG2oFixTag[] = "FIX";

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_G2O_TAGS_H_
