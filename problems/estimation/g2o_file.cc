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
#include "fmt/ranges.h"
#include "invgrad/io/atomic_file.h"
#include "problems/estimation/text_cursor.h"

namespace invgrad {
namespace {

using Information = decltype(PoseGraph::Edge::information);

int PoseSize(int dimension) { return dimension == 2 ? 3 : 7; }
int TangentSize(int dimension) { return dimension == 2 ? 3 : 6; }

// Returns false if the quaternion is zero. One of length one, to the rounding
// error of a normalization, is not normalized again, because that may change
// the last bit.
bool NormalizeQuaternion(PoseGraph::Pose* pose) {
  constexpr double kTolerance = 16 * std::numeric_limits<double>::epsilon();
  Eigen::Vector4d quaternion = pose->tail<4>();
  if (std::abs(quaternion.squaredNorm() - 1.0) <= kTolerance) return true;
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
    while (cursor_.NextLine()) ParseLine();
    if (read_.ids.empty()) {
      cursor_.FailAtToken("", "a VERTEX_SE2 or a VERTEX_SE3:QUAT");
    }
    ResolveIds();
    if (!cursor_.ok()) return false;
    read_.poses = Eigen::Map<const Eigen::MatrixXd>(
        poses_.data(), PoseSize(read_.dimension), read_.ids.size());
    *graph = std::move(read_);
    return true;
  }

 private:
  // An edge and FIX may precede the vertices that they refer to.
  struct IdOnLine {
    long line;
    long id;
  };

  void ParseLine() {
    const std::string_view tag = cursor_.NextToken();
    if (tag.empty() || tag[0] == '#') return;
    if (tag == "VERTEX_SE2") return ParseVertex(2);
    if (tag == "VERTEX_SE3:QUAT") return ParseVertex(3);
    if (tag == "EDGE_SE2") return ParseEdge(2);
    if (tag == "EDGE_SE3:QUAT") return ParseEdge(3);
    if (tag == "FIX") return ParseFixed();
    cursor_.FailAtToken(tag,
                        "VERTEX_SE2, VERTEX_SE3:QUAT, EDGE_SE2, EDGE_SE3:QUAT "
                        "or FIX");
  }

  void SetDimension(int dimension) {
    if (read_.dimension == 0) read_.dimension = dimension;
    if (read_.dimension != dimension) {
      cursor_.Fail(fmt::format("a tag of SE{}", dimension),
                   fmt::format("SE{} as in the lines before", read_.dimension));
    }
  }

  IdOnLine ParseId() {
    constexpr long kMaxId = std::numeric_limits<long>::max();
    return {cursor_.line_number(), cursor_.Integer("a vertex's id", 0, kMaxId)};
  }

  PoseGraph::Pose ParsePose() {
    PoseGraph::Pose pose(PoseSize(read_.dimension));
    for (double& value : pose) value = cursor_.Number("a pose's coordinate");
    if (read_.dimension == 3 && !NormalizeQuaternion(&pose)) {
      cursor_.Fail("the quaternion is zero", "a rotation");
    }
    return pose;
  }

  void ParseVertex(int dimension) {
    SetDimension(dimension);
    const long id = ParseId().id;
    const PoseGraph::Pose pose = ParsePose();
    cursor_.EndLine();
    if (!columns_.emplace(id, static_cast<int>(read_.ids.size())).second) {
      cursor_.Fail(fmt::format("vertex {} is there twice", id), "another id");
    }
    read_.ids.push_back(id);
    poses_.insert(poses_.end(), pose.data(), pose.data() + pose.size());
  }

  void ParseEdge(int dimension) {
    SetDimension(dimension);
    from_.push_back(ParseId());
    to_.push_back(ParseId());
    PoseGraph::Edge edge = {0, 0, ParsePose(), {}};
    if (from_.back().id == to_.back().id) {
      cursor_.Fail(
          fmt::format("the edge joins vertex {} with itself", to_.back().id),
          "two vertices");
    }
    const int size = TangentSize(read_.dimension);
    edge.information.resize(size, size);
    for (int i = 0; i < size; ++i) {
      for (int j = i; j < size; ++j) {
        edge.information(i, j) = edge.information(j, i) =
            cursor_.Number("an entry of the information matrix");
      }
    }
    cursor_.EndLine();
    if (!IsPositiveDefinite(edge.information)) {
      cursor_.Fail("the information matrix is not positive definite",
                   "the inverse of a covariance");
    }
    read_.edges.push_back(std::move(edge));
  }

  void ParseFixed() {
    do {
      fixed_.push_back(ParseId());
    } while (!cursor_.PeekToken().empty());
  }

  int FindColumn(const IdOnLine& vertex) {
    const auto found = columns_.find(vertex.id);
    if (found != columns_.end()) return found->second;
    cursor_.FailOnLine(vertex.line,
                       fmt::format("there is no vertex {}", vertex.id),
                       "the id of a vertex");
    return 0;
  }

  void ResolveIds() {
    for (size_t i = 0; i < from_.size(); ++i) {
      read_.edges[i].from = FindColumn(from_[i]);
      read_.edges[i].to = FindColumn(to_[i]);
    }
    std::unordered_set<int> columns;
    for (const IdOnLine& fixed : fixed_) {
      read_.fixed.push_back(FindColumn(fixed));
      if (!columns.insert(read_.fixed.back()).second) {
        cursor_.FailOnLine(fixed.line,
                           fmt::format("vertex {} is fixed twice", fixed.id),
                           "each vertex once");
      }
    }
  }

  TextCursor cursor_;
  PoseGraph read_;
  std::vector<double> poses_;  // all coordinates
  std::unordered_map<long, int> columns_;
  std::vector<IdOnLine> from_, to_;  // of read_.edges
  std::vector<IdOnLine> fixed_;
};

template <typename Vector>
auto Join(const Vector& values) {
  return fmt::join(values.begin(), values.end(), " ");
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
        out, "VERTEX_{} {} {}\n", kind, graph.ids[i], Join(graph.poses.col(i)));
  }
  for (const int column : graph.fixed) {
    fmt::format_to(out, "FIX {}\n", graph.ids[column]);
  }
  for (const PoseGraph::Edge& edge : graph.edges) {
    fmt::format_to(out,
                   "EDGE_{} {} {} {}",
                   kind,
                   graph.ids[edge.from],
                   graph.ids[edge.to],
                   Join(edge.measurement));
    for (int i = 0; i < edge.information.rows(); ++i) {
      const auto rest =
          edge.information.col(i).tail(edge.information.rows() - i);
      fmt::format_to(out, " {}", Join(rest));
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
