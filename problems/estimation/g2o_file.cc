#include "problems/estimation/g2o_file.h"

#include <cmath>
#include <limits>
#include <map>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "fmt/core.h"
#include "invgrad/io/atomic_file.h"
#include "problems/estimation/g2o_tags.h"
#include "problems/estimation/information.h"
#include "problems/estimation/pose_graph_start.h"
#include "problems/estimation/text_cursor.h"

namespace invgrad {
namespace {

using EdgeKind = PoseGraph::EdgeKind;

std::string KnownTags() {
  std::string tags;
  for (const G2oVertexTag& tag : kG2oVertexTags)
    tags += fmt::format("{}, ", tag.name);
  for (const G2oEdgeTag& tag : kG2oEdgeTags)
    tags += fmt::format("{}, ", tag.name);
  return fmt::format("one of {}{}, {}", tags, kG2oOffsetTag, kG2oFixTag);
}

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

class G2oParser {
 public:
  G2oParser(const std::string& text,
            const std::string& file,
            std::string* error)
      : cursor_(text, file, error) {}

  bool Parse(PoseGraph* graph) {
    while (cursor_.NextLine()) ParseLine();
    if (vertices_.empty() && read_.edges.empty()) {
      cursor_.FailAtToken("", "vertices and edges");
    }
    ResolveIds();
    if (!cursor_.ok()) return false;
    StartAlongEdges(&read_);
    if (!read_.poses.allFinite() || !read_.landmarks.allFinite()) {
      cursor_.Fail("start values along the edges overflow",
                   "VERTEX lines, or shorter edges");
      return false;
    }
    *graph = std::move(read_);
    return true;
  }

 private:
  // Edges and FIX may precede the vertices and offsets that they refer to.
  struct IdOnLine {
    long line;
    long id;
  };
  struct EdgeIds {
    std::vector<IdOnLine> vertices;
    std::vector<IdOnLine> offsets;
  };
  struct Vertex {
    bool is_landmark;
    int column;
  };

  void ParseLine() {
    const std::string_view tag = cursor_.NextToken();
    if (tag.empty() || tag[0] == '#') return;
    if (tag == kG2oFixTag) return ParseFixed();
    if (tag == kG2oOffsetTag) return ParseOffset();
    for (const G2oVertexTag& known : kG2oVertexTags) {
      if (tag == known.name) return ParseVertex(known);
    }
    for (const G2oEdgeTag& known : kG2oEdgeTags) {
      if (tag == known.name) return ParseEdge(known);
    }
    cursor_.FailAtToken(tag, KnownTags());
  }

  void SetDimension(int dimension) {
    if (read_.dimension == 0) read_.dimension = dimension;
    if (read_.dimension != dimension) {
      cursor_.Fail(fmt::format("a tag of SE{}", dimension),
                   fmt::format("SE{} as in the lines before", read_.dimension));
    }
  }

  IdOnLine ParseId(std::string_view expected = "a vertex's id") {
    constexpr long kMaxId = std::numeric_limits<long>::max();
    return {cursor_.line_number(), cursor_.Integer(expected, 0, kMaxId)};
  }

  PoseGraph::Pose ParsePose() {
    PoseGraph::Pose pose(PoseSize(read_.dimension));
    for (double& value : pose) value = cursor_.Number("a pose's coordinate");
    if (read_.dimension == 3 && !NormalizeQuaternion(&pose)) {
      cursor_.Fail("the quaternion is zero", "a rotation");
    }
    return pose;
  }

  PoseGraph::Pose ParsePoint() {
    PoseGraph::Pose point(read_.dimension);
    for (double& value : point) value = cursor_.Number("a point's coordinate");
    return point;
  }

  void AddVertex(long id, bool is_landmark, const PoseGraph::Pose& values) {
    std::vector<long>& ids = is_landmark ? read_.landmark_ids : read_.ids;
    const auto column = static_cast<int>(ids.size());
    if (!vertices_.emplace(id, Vertex{is_landmark, column}).second) {
      cursor_.Fail(fmt::format("vertex {} is there twice", id), "another id");
    }
    ids.push_back(id);
    std::vector<double>& all = is_landmark ? landmarks_ : poses_;
    all.insert(all.end(), values.begin(), values.end());
  }

  void ParseVertex(const G2oVertexTag& tag) {
    SetDimension(tag.dimension);
    const long id = ParseId().id;
    const PoseGraph::Pose values = tag.is_landmark ? ParsePoint() : ParsePose();
    cursor_.EndLine();
    AddVertex(id, tag.is_landmark, values);
  }

  void ParseOffset() {
    SetDimension(3);
    const long id = ParseId("an offset's id").id;
    read_.offsets.push_back({id, ParsePose()});
    cursor_.EndLine();
    const auto index = static_cast<int>(read_.offsets.size()) - 1;
    if (!offsets_.emplace(id, index).second) {
      cursor_.Fail(fmt::format("offset {} is there twice", id), "another id");
    }
  }

  void ParseEdge(const G2oEdgeTag& tag) {
    SetDimension(tag.dimension);
    EdgeIds ids;
    ids.vertices.push_back(ParseId());
    if (tag.kind != EdgeKind::kPrior) {
      ids.vertices.push_back(ParseId());
      if (ids.vertices[0].id == ids.vertices[1].id) {
        cursor_.Fail(fmt::format("the edge joins vertex {} with itself",
                                 ids.vertices[0].id),
                     "two vertices");
      }
    }
    for (int i = 0; i < tag.num_offsets; ++i) {
      ids.offsets.push_back(ParseId("an offset's id"));
    }
    PoseGraph::Edge edge;
    edge.kind = tag.kind;
    const bool is_point = tag.kind == EdgeKind::kLandmark;
    edge.measurement = is_point ? ParsePoint() : ParsePose();
    ParseInformation(is_point ? tag.dimension : TangentSize(tag.dimension),
                     &edge);
    cursor_.EndLine();
    read_.edges.push_back(std::move(edge));
    edge_ids_.push_back(std::move(ids));
  }

  void ParseInformation(int size, PoseGraph::Edge* edge) {
    edge->information.resize(size, size);
    for (int i = 0; i < size; ++i) {
      for (int j = i; j < size; ++j) {
        edge->information(i, j) = edge->information(j, i) =
            cursor_.Number("an entry of the information matrix");
      }
    }
    Eigen::MatrixXd unused;
    if (!UpperRoot(edge->information, &unused)) {
      cursor_.Fail("the information matrix has a negative eigenvalue",
                   "the inverse of a covariance, or a semidefinite matrix");
    }
  }

  void ParseFixed() {
    do {
      fixed_.push_back(ParseId());
    } while (!cursor_.PeekToken().empty());
  }

  static bool IsLandmark(const PoseGraph::Edge& edge, size_t end) {
    return edge.kind == EdgeKind::kLandmark && end == 1;
  }

  // Those that only edges name, poses first.
  void AddVerticesOfEdges() {
    std::map<std::pair<bool, long>, long> missing;  // the line
    for (size_t i = 0; i < edge_ids_.size(); ++i) {
      const std::vector<IdOnLine>& vertices = edge_ids_[i].vertices;
      for (size_t end = 0; end < vertices.size(); ++end) {
        if (vertices_.count(vertices[end].id) > 0) continue;
        missing.insert({{IsLandmark(read_.edges[i], end), vertices[end].id},
                        vertices[end].line});
      }
    }
    for (const auto& [vertex, line] : missing) {
      const auto [is_landmark, id] = vertex;
      if (vertices_.count(id) > 0) continue;  // FindVertex says so
      const int size =
          is_landmark ? read_.dimension : PoseSize(read_.dimension);
      AddVertex(id, is_landmark, PoseGraph::Pose::Zero(size));
      ++(is_landmark ? read_.num_landmarks_by_edges : read_.num_poses_by_edges);
    }
  }

  int FindVertex(const IdOnLine& vertex, bool is_landmark) {
    const Vertex& found = vertices_.at(vertex.id);
    if (found.is_landmark != is_landmark) {
      constexpr const char* kNames[] = {"a pose", "a landmark"};
      cursor_.FailOnLine(
          vertex.line,
          fmt::format(
              "vertex {} is {}", vertex.id, kNames[found.is_landmark ? 1 : 0]),
          kNames[is_landmark ? 1 : 0]);
    }
    return found.column;
  }

  int FindOffset(const IdOnLine& offset) {
    const auto found = offsets_.find(offset.id);
    if (found != offsets_.end()) return found->second;
    cursor_.FailOnLine(offset.line,
                       fmt::format("there is no offset {}", offset.id),
                       fmt::format("the id of a {}", kG2oOffsetTag));
    return 0;
  }

  void ResolveIds() {
    if (!cursor_.ok()) return;
    AddVerticesOfEdges();
    read_.poses = Eigen::Map<const Eigen::MatrixXd>(
        poses_.data(), PoseSize(read_.dimension), read_.ids.size());
    read_.landmarks = Eigen::Map<const Eigen::MatrixXd>(
        landmarks_.data(), read_.dimension, read_.landmark_ids.size());
    for (size_t i = 0; i < edge_ids_.size(); ++i) {
      const EdgeIds& ids = edge_ids_[i];
      PoseGraph::Edge& edge = read_.edges[i];
      edge.from = FindVertex(ids.vertices[0], false);
      if (ids.vertices.size() > 1) {
        edge.to = FindVertex(ids.vertices[1], IsLandmark(edge, 1));
      }
      if (!ids.offsets.empty()) edge.offset_from = FindOffset(ids.offsets[0]);
      if (ids.offsets.size() > 1) edge.offset_to = FindOffset(ids.offsets[1]);
    }
    ResolveFixed();
  }

  void ResolveFixed() {
    std::unordered_set<long> ids;
    for (const IdOnLine& fixed : fixed_) {
      const auto found = vertices_.find(fixed.id);
      if (found == vertices_.end()) {
        cursor_.FailOnLine(fixed.line,
                           fmt::format("there is no vertex {}", fixed.id),
                           "the id of a vertex");
        return;
      }
      if (!ids.insert(fixed.id).second) {
        cursor_.FailOnLine(fixed.line,
                           fmt::format("vertex {} is fixed twice", fixed.id),
                           "each vertex once");
      }
      (found->second.is_landmark ? read_.fixed_landmarks : read_.fixed)
          .push_back(found->second.column);
    }
  }

  TextCursor cursor_;
  PoseGraph read_;
  std::vector<double> poses_;  // all coordinates
  std::vector<double> landmarks_;
  std::unordered_map<long, Vertex> vertices_;  // by id
  std::unordered_map<long, int> offsets_;      // indices by id
  std::vector<EdgeIds> edge_ids_;              // of read_.edges
  std::vector<IdOnLine> fixed_;
};

}  // namespace

bool ParseG2o(const std::string& text,
              const std::string& file,
              PoseGraph* graph,
              std::string* error) {
  return G2oParser(text, file, error).Parse(graph);
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
