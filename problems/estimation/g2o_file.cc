#include "problems/estimation/g2o_file.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "Eigen/Cholesky"
#include "invgrad/io/atomic_file.h"
#include "problems/estimation/text_cursor.h"

namespace invgrad {
namespace {

using Information = decltype(PoseGraph::Edge::information);

constexpr long kMaxId = std::numeric_limits<long>::max();

int PoseSize(int dimension) { return dimension == 2 ? 3 : 7; }
int TangentSize(int dimension) { return dimension == 2 ? 3 : 6; }

// Length one up to the rounding of a normalization, which a second one would
// change in the last bit: such quaternions are left alone.
bool HasLengthOne(const Eigen::Vector4d& quaternion) {
  constexpr double kTolerance = 16 * std::numeric_limits<double>::epsilon();
  return std::abs(quaternion.squaredNorm() - 1.0) <= kTolerance;
}

// False if it is zero.
bool NormalizeQuaternion(PoseGraph::Pose* pose) {
  Eigen::Vector4d quaternion = pose->tail<4>();
  if (HasLengthOne(quaternion)) {
    return true;
  }
  const double largest = quaternion.cwiseAbs().maxCoeff();
  if (largest == 0.0) {
    return false;
  }
  quaternion /= largest;  // whose square cannot overflow or vanish
  pose->tail<4>() = quaternion / quaternion.norm();
  return true;
}

bool IsPositiveDefinite(const Information& information) {
  // Eigen takes NaN, from entries near overflow, for a positive pivot.
  const Eigen::LLT<Information> factorization(information);
  return factorization.info() == Eigen::Success &&
         factorization.matrixLLT().allFinite();
}

class G2oParser {
 public:
  G2oParser(const std::string& text,
            const std::string& file,
            std::string* error)
      : cursor_(text, file, error) {}

  bool Parse(PoseGraph* graph) {
    while (cursor_.NextLine()) {
      if (!ParseLine()) {
        return false;
      }
    }
    if (read_.ids.empty()) {
      return cursor_.FailAtToken("", "a VERTEX_SE2 or a VERTEX_SE3:QUAT");
    }
    if (!ResolveEdges() || !ResolveFixed()) {
      return false;
    }
    read_.poses = Eigen::Map<const Eigen::MatrixXd>(
        poses_.data(), PoseSize(read_.dimension), read_.ids.size());
    *graph = std::move(read_);
    return true;
  }

 private:
  // Ids may be used before their vertex comes.
  struct IdsOfEdge {
    long line;
    long from;
    long to;
  };
  struct FixedId {
    long line;
    long id;
  };

  bool ParseLine() {
    const std::string_view tag = cursor_.NextToken();
    if (tag.empty() || tag[0] == '#') {
      return true;
    }
    if (tag == "VERTEX_SE2") {
      return SetDimension(2) && ParseVertex();
    }
    if (tag == "VERTEX_SE3:QUAT") {
      return SetDimension(3) && ParseVertex();
    }
    if (tag == "EDGE_SE2") {
      return SetDimension(2) && ParseEdge();
    }
    if (tag == "EDGE_SE3:QUAT") {
      return SetDimension(3) && ParseEdge();
    }
    if (tag == "FIX") {
      return ParseFixed();
    }
    return cursor_.FailAtToken(tag,
                               "VERTEX_SE2, VERTEX_SE3:QUAT, EDGE_SE2, "
                               "EDGE_SE3:QUAT or FIX");
  }

  bool SetDimension(int dimension) {
    if (read_.dimension == 0) {
      read_.dimension = dimension;
    }
    return read_.dimension == dimension ||
           cursor_.Fail("a tag of SE" + std::to_string(dimension),
                        "SE" + std::to_string(read_.dimension) +
                            " as in the lines before");
  }

  bool ParseId(long* id) {
    return cursor_.ReadInteger("a vertex's id", 0, kMaxId, id);
  }

  bool ParsePose(PoseGraph::Pose* pose) {
    pose->resize(PoseSize(read_.dimension));
    for (double& value : *pose) {
      if (!cursor_.ReadNumber("a pose's coordinate", &value)) {
        return false;
      }
    }
    return read_.dimension == 2 || NormalizeQuaternion(pose) ||
           cursor_.Fail("the quaternion is zero", "a rotation");
  }

  bool ParseVertex() {
    long id = 0;
    PoseGraph::Pose pose;
    if (!ParseId(&id) || !ParsePose(&pose) || !cursor_.ReadLineEnd()) {
      return false;
    }
    if (!columns_.emplace(id, static_cast<int>(read_.ids.size())).second) {
      return cursor_.Fail("vertex " + std::to_string(id) + " is there twice",
                          "another id");
    }
    read_.ids.push_back(id);
    poses_.insert(poses_.end(), pose.data(), pose.data() + pose.size());
    return true;
  }

  bool ParseEdge() {
    IdsOfEdge ids = {cursor_.line_number(), 0, 0};
    PoseGraph::Edge edge = {};
    if (!ParseId(&ids.from) || !ParseId(&ids.to) ||
        !ParsePose(&edge.measurement)) {
      return false;
    }
    if (ids.from == ids.to) {
      return cursor_.Fail(
          "the edge joins vertex " + std::to_string(ids.to) + " with itself",
          "two vertices");
    }
    const int size = TangentSize(read_.dimension);
    edge.information.resize(size, size);
    for (int i = 0; i < size; ++i) {
      for (int j = i; j < size; ++j) {
        if (!cursor_.ReadNumber("an entry of the information matrix",
                                &edge.information(i, j))) {
          return false;
        }
        edge.information(j, i) = edge.information(i, j);
      }
    }
    if (!cursor_.ReadLineEnd()) {
      return false;
    }
    if (!IsPositiveDefinite(edge.information)) {
      return cursor_.Fail("the information matrix is not positive definite",
                          "the inverse of a covariance");
    }
    read_.edges.push_back(std::move(edge));
    ids_of_edges_.push_back(ids);
    return true;
  }

  bool ParseFixed() {
    do {
      FixedId fixed = {cursor_.line_number(), 0};
      if (!ParseId(&fixed.id)) {
        return false;
      }
      fixed_.push_back(fixed);
    } while (!cursor_.PeekToken().empty());
    return true;
  }

  bool FindColumn(long line, long id, int* column) const {
    const auto found = columns_.find(id);
    if (found == columns_.end()) {
      return cursor_.FailOnLine(line,
                                "there is no vertex " + std::to_string(id),
                                "the id of a vertex");
    }
    *column = found->second;
    return true;
  }

  bool ResolveEdges() {
    for (size_t i = 0; i < ids_of_edges_.size(); ++i) {
      const IdsOfEdge& ids = ids_of_edges_[i];
      if (!FindColumn(ids.line, ids.from, &read_.edges[i].from) ||
          !FindColumn(ids.line, ids.to, &read_.edges[i].to)) {
        return false;
      }
    }
    return true;
  }

  bool ResolveFixed() {
    std::unordered_set<int> columns;
    for (const FixedId& fixed : fixed_) {
      int column = 0;
      if (!FindColumn(fixed.line, fixed.id, &column)) {
        return false;
      }
      if (!columns.insert(column).second) {
        return cursor_.FailOnLine(
            fixed.line,
            "vertex " + std::to_string(fixed.id) + " is fixed twice",
            "each vertex once");
      }
      read_.fixed.push_back(column);
    }
    return true;
  }

  TextCursor cursor_;
  PoseGraph read_;
  std::vector<double> poses_;  // one behind the other
  std::unordered_map<long, int> columns_;
  std::vector<IdsOfEdge> ids_of_edges_;  // of read_.edges
  std::vector<FixedId> fixed_;
};

bool CheckPose(int dimension, const PoseGraph::Pose& pose) {
  return pose.size() == PoseSize(dimension) && pose.allFinite() &&
         (dimension == 2 || HasLengthOne(pose.tail<4>()));
}

bool CheckEdge(const PoseGraph& graph, const PoseGraph::Edge& edge) {
  const int num_poses = static_cast<int>(graph.ids.size());
  const int size = TangentSize(graph.dimension);
  return edge.from >= 0 && edge.from < num_poses && edge.to >= 0 &&
         edge.to < num_poses && edge.from != edge.to &&
         CheckPose(graph.dimension, edge.measurement) &&
         edge.information.rows() == size && edge.information.cols() == size &&
         edge.information == edge.information.transpose() &&
         IsPositiveDefinite(edge.information);
}

template <typename Vector>
void AppendRow(const Vector& values, std::string* text) {
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    *text += ' ';
    AppendNumber(values(i), text);
  }
}

void AppendId(long id, std::string* text) {
  *text += ' ';
  AppendNumber(id, text);
}

}  // namespace

bool ParseG2o(const std::string& text,
              const std::string& file,
              PoseGraph* graph,
              std::string* error) {
  return G2oParser(text, file, error).Parse(graph);
}

std::string G2oText(const PoseGraph& graph) {
  const std::string kind = graph.dimension == 2 ? "SE2" : "SE3:QUAT";
  std::string text;
  for (size_t i = 0; i < graph.ids.size(); ++i) {
    text += "VERTEX_" + kind;
    AppendId(graph.ids[i], &text);
    AppendRow(graph.poses.col(i), &text);
    text += '\n';
  }
  for (const int column : graph.fixed) {
    text += "FIX";
    AppendId(graph.ids[column], &text);
    text += '\n';
  }
  for (const PoseGraph::Edge& edge : graph.edges) {
    text += "EDGE_" + kind;
    AppendId(graph.ids[edge.from], &text);
    AppendId(graph.ids[edge.to], &text);
    AppendRow(edge.measurement, &text);
    for (int i = 0; i < edge.information.rows(); ++i) {
      AppendRow(edge.information.row(i).tail(edge.information.cols() - i),
                &text);
    }
    text += '\n';
  }
  return text;
}

bool CheckG2o(const PoseGraph& graph, std::string* error) {
  const int num_poses = static_cast<int>(graph.ids.size());
  if ((graph.dimension != 2 && graph.dimension != 3) || num_poses == 0 ||
      graph.poses.rows() != PoseSize(graph.dimension) ||
      graph.poses.cols() != num_poses) {
    *error = "the dimension is neither 2 nor 3, or other than its poses'";
    return false;
  }
  std::unordered_set<long> ids;
  for (int i = 0; i < num_poses; ++i) {
    if (graph.ids[i] < 0 || !ids.insert(graph.ids[i]).second ||
        !CheckPose(graph.dimension, graph.poses.col(i))) {
      *error = "pose " + std::to_string(i) +
               " has an id that is negative or used twice, is not finite, or "
               "has a quaternion of other length than one";
      return false;
    }
  }
  std::unordered_set<int> fixed;
  for (const int column : graph.fixed) {
    if (column < 0 || column >= num_poses || !fixed.insert(column).second) {
      *error = "pose " + std::to_string(column) +
               " is fixed and does not exist, or is fixed twice";
      return false;
    }
  }
  for (size_t i = 0; i < graph.edges.size(); ++i) {
    if (!CheckEdge(graph, graph.edges[i])) {
      *error = "edge " + std::to_string(i) +
               " does not join two poses by a measurement of their dimension "
               "and a positive definite information matrix";
      return false;
    }
  }
  return true;
}

bool ReadG2oFile(const std::string& path,
                 PoseGraph* graph,
                 std::string* error) {
  std::string text;
  return ReadFile(path, &text, error) && ParseG2o(text, path, graph, error);
}

bool WriteG2oFile(const std::string& path,
                  const PoseGraph& graph,
                  std::string* error) {
  std::string problem;
  if (!CheckG2o(graph, &problem)) {
    *error = "cannot write " + path + ": " + problem;
    return false;
  }
  return WriteFile(path, G2oText(graph), error);
}

}  // namespace invgrad
