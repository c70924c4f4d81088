// Reads and writes pose graphs in g2o's text format.
//
//   VERTEX_SE2 id x y theta
//   VERTEX_SE3:QUAT id x y z qx qy qz qw
//   EDGE_SE2 from to x y theta  I11 I12 I13 I22 I23 I33
//   EDGE_SE3:QUAT from to x y z qx qy qz qw  I11 I12 ... I66
//   FIX id ...
//
// Information matrices are given by their upper triangles, row by row. Lines
// may be in any order; blank lines and lines that start with # are skipped. A
// file is either 2D or 3D. Other tags are errors.
//
// Cost:    linear in the size of the text, which also bounds the memory.
// Fails:   returns false with "FILE:LINE: what is wrong; expected ..." if the
//          text has no vertex, a line has a wrong count of numbers, an id is
//          used twice or not defined, an edge joins a pose with itself,
//          dimensions are mixed, a number is not finite, a quaternion is zero,
//          or an information matrix is not positive definite. *graph is then
//          unchanged.
//
// [1] Kuemmerle, Grisetti, Strasdat, Konolige, Burgard. g2o: A General
//     Framework for Graph Optimization. ICRA 2011.
#ifndef PROBLEMS_ESTIMATION_G2O_FILE_H_
#define PROBLEMS_ESTIMATION_G2O_FILE_H_

#include <string>
#include <vector>

#include "Eigen/Core"

namespace invgrad {

struct PoseGraph {
  // x y theta, or x y z qx qy qz qw with a quaternion of length one.
  using Pose = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 7, 1>;

  struct Edge {
    int from;  // columns of `poses`
    int to;
    Pose measurement;
    // 3 x 3, or 6 x 6 (translation, rotation).
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6> information;
  };

  int dimension = 0;       // 2 or 3
  std::vector<long> ids;   // of the poses, in the file's order
  Eigen::MatrixXd poses;   // 3 or 7 rows, one pose a column
  std::vector<int> fixed;  // columns of `poses` that FIX names
  std::vector<Edge> edges;
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
