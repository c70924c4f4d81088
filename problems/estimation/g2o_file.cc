#include "problems/estimation/g2o_file.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "Eigen/Cholesky"
#include "fmt/format.h"
#include "invgrad/io/atomic_file.h"
#include "problems/estimation/text_cursor.h"

namespace invgrad {
namespace {

using Information = decltype(PoseGraph::Edge::information);

constexpr long kMaxId = std::numeric_limits<long>::max();

int PoseSize(int dimension) { return dimension == 2 ? 3 : 7; }
int TangentSize(int dimension) { return dimension == 2 ? 3 : 6; }

// The tolerance for length one, the rounding error of a normalization. Such
// quaternions are not normalized again, because that may change the last bit.
bool HasLengthOne(const Eigen::Vector4d& quaternion) {
  constexpr double kTolerance = 16 * std::numeric_limits<double>::epsilon();
  return std::abs(quaternion.squaredNorm() - 1.0) <= kTolerance;
}

// False if it is zero.
bool NormalizeQuaternion(PoseGraph::Pose* pose) {
  Eigen::Vector4d quaternion = pose->tail<4>();
  if (HasLengthOne(quaternion)) return true;
  const double largest = quaternion.cwiseAbs().maxCoeff();
  if (largest == 0.0) return false;
  quaternion /= largest;  // so that squares cannot overflow or vanish
  pose->tail<4>() = quaternion / quaternion.norm();
  return true;
}

bool IsPositiveDefinite(const Information& information) {
  // Eigen accepts a NaN pivot, from entries near overflow, as positive.
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
      if (!ParseLine()) return false;
    }
    if (read_.ids.empty()) {
      return cursor_.FailAtToken("", "a VERTEX_SE2 or a VERTEX_SE3:QUAT");
    }
    if (!ResolveEdges() || !ResolveFixed()) return false;
    read_.poses = Eigen::Map<const Eigen::MatrixXd>(
        poses_.data(), PoseSize(read_.dimension), read_.ids.size());
    *graph = std::move(read_);
    return true;
  }

 private:
  // An edge may precede the vertices that it refers to.
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
    if (tag.empty() || tag[0] == '#') return true;
    if (tag == "VERTEX_SE2") return SetDimension(2) && ParseVertex();
    if (tag == "VERTEX_SE3:QUAT") return SetDimension(3) && ParseVertex();
    if (tag == "EDGE_SE2") return SetDimension(2) && ParseEdge();
    if (tag == "EDGE_SE3:QUAT") return SetDimension(3) && ParseEdge();
    if (tag == "FIX") return ParseFixed();
    return cursor_.FailAtToken(tag,
                               "VERTEX_SE2, VERTEX_SE3:QUAT, EDGE_SE2, "
                               "EDGE_SE3:QUAT or FIX");
  }

  bool SetDimension(int dimension) {
    if (read_.dimension == 0) read_.dimension = dimension;
    return read_.dimension == dimension ||
           cursor_.Fail(
               fmt::format("a tag of SE{}", dimension),
               fmt::format("SE{} as in the lines before", read_.dimension));
  }

  bool ParseId(long* id) {
    return cursor_.ReadInteger("a vertex's id", 0, kMaxId, id);
  }

  bool ParsePose(PoseGraph::Pose* pose) {
    pose->resize(PoseSize(read_.dimension));
    for (double& value : *pose) {
      if (!cursor_.ReadNumber("a pose's coordinate", &value)) return false;
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
      return cursor_.Fail(fmt::format("vertex {} is there twice", id),
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
          fmt::format("the edge joins vertex {} with itself", ids.to),
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
    if (!cursor_.ReadLineEnd()) return false;
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
      if (!ParseId(&fixed.id)) return false;
      fixed_.push_back(fixed);
    } while (!cursor_.PeekToken().empty());
    return true;
  }

  bool FindColumn(long line, long id, int* column) const {
    const auto found = columns_.find(id);
    if (found == columns_.end()) {
      return cursor_.FailOnLine(
          line, fmt::format("there is no vertex {}", id), "the id of a vertex");
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
      if (!FindColumn(fixed.line, fixed.id, &column)) return false;
      if (!columns.insert(column).second) {
        return cursor_.FailOnLine(
            fixed.line,
            fmt::format("vertex {} is fixed twice", fixed.id),
            "each vertex once");
      }
      read_.fixed.push_back(column);
    }
    return true;
  }

  TextCursor cursor_;
  PoseGraph read_;
  std::vector<double> poses_;  // all coordinates
  std::unordered_map<long, int> columns_;
  std::vector<IdsOfEdge> ids_of_edges_;  // of read_.edges
  std::vector<FixedId> fixed_;
};

template <typename Vector>
std::string Join(const Vector& values) {
  std::string text;
  for (const double value : values) {
    fmt::format_to(std::back_inserter(text), " {}", value);
  }
  return text;
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
  const auto out = std::back_inserter(text);
  for (size_t i = 0; i < graph.ids.size(); ++i) {
    fmt::format_to(
        out, "VERTEX_{} {}{}\n", kind, graph.ids[i], Join(graph.poses.col(i)));
  }
  for (const int column : graph.fixed) {
    fmt::format_to(out, "FIX {}\n", graph.ids[column]);
  }
  for (const PoseGraph::Edge& edge : graph.edges) {
    fmt::format_to(out,
                   "EDGE_{} {} {}{}",
                   kind,
                   graph.ids[edge.from],
                   graph.ids[edge.to],
                   Join(edge.measurement));
    const auto& information = edge.information;
    for (int i = 0; i < information.rows(); ++i) {
      text += Join(information.row(i).tail(information.cols() - i));
    }
    text += '\n';
  }
  return text;
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
  return WriteReadable(path, graph, G2oText, ParseG2o, error);
}

}  // namespace invgrad
