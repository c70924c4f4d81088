// Writes g2o's text format.

#include <iterator>
#include <string>
#include <vector>

#include "fmt/ranges.h"
#include "problems/estimation/g2o_file.h"
#include "problems/estimation/g2o_tags.h"

namespace invgrad {
namespace {

using EdgeKind = PoseGraph::EdgeKind;

template <typename Vector>
auto Join(const Vector& values) {
  return fmt::join(values.begin(), values.end(), " ");
}

const char* NameOf(const PoseGraph& graph, const PoseGraph::Edge& edge) {
  const int num_offsets =
      (edge.offset_from < 0 ? 0 : 1) + (edge.offset_to < 0 ? 0 : 1);
  for (const G2oEdgeTag& tag : kG2oEdgeTags) {
    if (tag.dimension == graph.dimension && tag.kind == edge.kind &&
        tag.num_offsets == num_offsets) {
      return tag.name;
    }
  }
  return "EDGE_UNKNOWN";  // is not read back
}

void WriteEdge(const PoseGraph& graph,
               const PoseGraph::Edge& edge,
               std::string* text) {
  const auto out = std::back_inserter(*text);
  fmt::format_to(out, "{} {}", NameOf(graph, edge), graph.ids[edge.from]);
  if (edge.kind != EdgeKind::kPrior) {
    const std::vector<long>& ids =
        edge.kind == EdgeKind::kLandmark ? graph.landmark_ids : graph.ids;
    fmt::format_to(out, " {}", ids[edge.to]);
  }
  for (const int offset : {edge.offset_from, edge.offset_to}) {
    if (offset >= 0) fmt::format_to(out, " {}", graph.offsets[offset].id);
  }
  fmt::format_to(out, " {}", Join(edge.measurement));
  const Eigen::Index size = edge.information.rows();
  for (Eigen::Index i = 0; i < size; ++i) {
    fmt::format_to(out, " {}", Join(edge.information.col(i).tail(size - i)));
  }
  *text += '\n';
}

}  // namespace

std::string G2oText(const PoseGraph& graph) {
  std::string text;
  const auto out = std::back_inserter(text);
  for (const PoseGraph::Offset& offset : graph.offsets) {
    fmt::format_to(
        out, "{} {} {}\n", kG2oOffsetTag, offset.id, Join(offset.pose));
  }
  for (size_t i = 0; i < graph.ids.size(); ++i) {
    fmt::format_to(out,
                   "{} {} {}\n",
                   graph.dimension == 2 ? "VERTEX_SE2" : "VERTEX_SE3:QUAT",
                   graph.ids[i],
                   Join(graph.poses.col(i)));
  }
  for (size_t i = 0; i < graph.landmark_ids.size(); ++i) {
    fmt::format_to(out,
                   "{} {} {}\n",
                   graph.dimension == 2 ? "VERTEX_XY" : "VERTEX_TRACKXYZ",
                   graph.landmark_ids[i],
                   Join(graph.landmarks.col(i)));
  }
  for (const int column : graph.fixed) {
    fmt::format_to(out, "{} {}\n", kG2oFixTag, graph.ids[column]);
  }
  for (const int column : graph.fixed_landmarks) {
    fmt::format_to(out, "{} {}\n", kG2oFixTag, graph.landmark_ids[column]);
  }
  for (const PoseGraph::Edge& edge : graph.edges) WriteEdge(graph, edge, &text);
  return text;
}

}  // namespace invgrad
