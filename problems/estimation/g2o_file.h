// Reads and writes pose graphs in g2o's text format [1].
//
//   VERTEX_SE2 id x y theta               VERTEX_SE3:QUAT id P
//   VERTEX_XY id x y                      VERTEX_TRACKXYZ id x y z
//   EDGE_SE2 i j x y theta I              EDGE_SE3:QUAT i j P I
//   EDGE_PRIOR_SE2 i x y theta I          EDGE_SE3_PRIOR i k P I
//   EDGE_SE2_XY i j x y I                 EDGE_SE3_TRACKXYZ i j k x y z I
//                                         EDGE_SE3_OFFSET i j k l P I
//   FIX id ...                            PARAMS_SE3OFFSET k P
//
// P: x y z qx qy qz qw. I: the upper triangle of an information matrix, row by
// row. k, l: sensors' poses on the robot, of PARAMS_SE3OFFSET.
//
// Lines may be in any order; blank lines and lines that start with # are
// skipped. A file is either 2D or 3D. Other tags are errors. Poses and
// landmarks without a VERTEX line are those that edges name; they follow the
// others, by their ids, and start where the edges lead (pose_graph_start.h).
//
// Cost:    linear in the size of the text, which also bounds the memory.
// Fails:   returns false with "FILE:LINE: what is wrong; expected ..." if the
//          text has no vertex and no edge, a line has a wrong count of numbers,
//          an id is used twice, or for a pose and a landmark, FIX or k names
//          nothing, an edge joins a pose with itself, dimensions are mixed, a
//          number is not finite, a quaternion is zero, or an information matrix
//          is not semidefinite (information.h). *graph is then unchanged.
//
// [1] Kuemmerle, Grisetti, Strasdat, Konolige, Burgard. g2o: A General
//     Framework for Graph Optimization. ICRA 2011.
//     https://github.com/RainerKuemmerle/g2o/wiki/File-Format
#ifndef PROBLEMS_ESTIMATION_G2O_FILE_H_
#define PROBLEMS_ESTIMATION_G2O_FILE_H_

#include <string>
#include <vector>

#include "Eigen/Core"

namespace invgrad {

struct PoseGraph {
  // x y theta, or x y z qx qy qz qw with a quaternion of length one.
  using Pose = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 7, 1>;

  enum class EdgeKind {
    kRelative,  // of the pose `to` in the frame of the pose `from`
    kPrior,     // of the pose `from` in the world
    kLandmark,  // of the landmark `to` in the frame of the pose `from`
  };
  struct Edge {
    EdgeKind kind = EdgeKind::kRelative;
    int from = 0;  // a column of `poses`
    int to = 0;    // a column of `poses` or `landmarks`; kPrior: unused
    // What is measured are the poses of sensors, in `offsets`, on the poses;
    // -1: of the pose itself.
    int offset_from = -1;
    int offset_to = -1;
    Pose measurement;  // kLandmark: x y or x y z
    // In the frame of the measurement: translation, rotation. Semidefinite.
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6> information;
  };
  struct Offset {
    long id;
    Pose pose;
  };

  int dimension = 0;               // 2 or 3
  std::vector<long> ids;           // of the poses
  Eigen::MatrixXd poses;           // 3 or 7 rows, one pose a column
  std::vector<long> landmark_ids;  // none is in `ids`
  Eigen::MatrixXd landmarks;       // 2 or 3 rows, one landmark a column
  std::vector<int> fixed;          // columns of `poses` that FIX names
  std::vector<int> fixed_landmarks;
  std::vector<Offset> offsets;
  std::vector<Edge> edges;

  // Of the last columns, which have no VERTEX line.
  int num_poses_by_edges = 0;
  int num_landmarks_by_edges = 0;
};

// `file`: the name of the text in messages.
bool ParseG2o(const std::string& text,
              const std::string& file,
              PoseGraph* graph,
              std::string* error);

// Formats `graph` as text that ParseG2o reads back bit for bit.
std::string G2oText(const PoseGraph& graph);

bool ReadG2oFile(const std::string& path, PoseGraph* graph, std::string* error);
// Writes plain text if ParseG2o can read it back.
bool WriteG2oFile(const std::string& path,
                  const PoseGraph& graph,
                  std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_G2O_FILE_H_
