#include "problems/estimation/pose_graph_start.h"

#include <algorithm>
#include <functional>
#include <queue>
#include <tuple>
#include <vector>

#include "problems/estimation/information.h"
#include "problems/estimation/motion.h"
#include "problems/estimation/pose_graph.h"

namespace invgrad {
namespace {

template <int kDimension>
class SpanningTree {
 public:
  explicit SpanningTree(PoseGraph* graph)
      : graph_(*graph),
        num_poses_(graph->poses.cols()),
        has_value_(num_poses_ + graph->landmarks.cols(), true),
        edges_at_(num_poses_) {
    std::fill_n(has_value_.begin() + num_poses_ - graph->num_poses_by_edges,
                graph->num_poses_by_edges,
                false);
    std::fill_n(has_value_.end() - graph->num_landmarks_by_edges,
                graph->num_landmarks_by_edges,
                false);
    for (const PoseGraph::Edge& edge : graph->edges) {
      edges_at_[edge.from].push_back(&edge);
      if (edge.kind == PoseGraph::EdgeKind::kRelative) {
        edges_at_[edge.to].push_back(&edge);
      }
    }
  }

  void Grow() {
    for (Eigen::Index j = 0; j < num_poses_; ++j) {
      if (has_value_[j]) PushEdges(j, {0, 0});
    }
    Follow();
    // Parts of the graph in which no pose has a value.
    for (const PoseGraph::Edge& edge : graph_.edges) {
      if (edge.kind != PoseGraph::EdgeKind::kPrior) continue;
      Set(edge.from,
          ToMotion<kDimension>(edge.measurement.data()) *
              Inverse(Offset(edge.offset_from)),
          {0, 0});
      Follow();
    }
    for (Eigen::Index j = 0; j < num_poses_; ++j) {
      Set(j, Pose::Identity(), {0, 0});
      Follow();
    }
  }

 private:
  using Pose = Motion<double, kDimension>;

  Pose PoseAt(Eigen::Index j) const {
    return ToMotion<kDimension>(graph_.poses.col(j).data());
  }
  Pose Offset(int index) const {
    return OffsetMotion<kDimension>(graph_, index);
  }

  // Of a path from a value: how many of its edges are semidefinite, and how
  // many there are.
  struct Length {
    int num_semidefinite;
    int num_edges;
  };
  // In order; the last number, of the edge, decides among equal paths.
  using Entry = std::tuple<int, int, std::size_t>;

  void PushEdges(Eigen::Index pose, Length length) {
    for (const PoseGraph::Edge* edge : edges_at_[pose]) {
      if (edge->kind == PoseGraph::EdgeKind::kPrior) continue;
      queue_.emplace(
          length.num_semidefinite + (IsDefinite(edge->information) ? 0 : 1),
          length.num_edges + 1,
          edge - graph_.edges.data());
    }
  }

  void Set(Eigen::Index pose, const Pose& value, Length length) {
    if (has_value_[pose]) return;
    has_value_[pose] = true;
    graph_.poses.col(pose) = ToPose(value);
    PushEdges(pose, length);
  }

  void Follow() {
    while (!queue_.empty()) {
      const auto [num_semidefinite, num_edges, index] = queue_.top();
      queue_.pop();
      const PoseGraph::Edge& edge = graph_.edges[index];
      const Length length = {num_semidefinite, num_edges};
      const Pose from = Offset(edge.offset_from);
      if (edge.kind == PoseGraph::EdgeKind::kLandmark) {
        if (has_value_[num_poses_ + edge.to]) continue;
        has_value_[num_poses_ + edge.to] = true;
        graph_.landmarks.col(edge.to) =
            PoseAt(edge.from) * (from * typename Pose::Point(edge.measurement));
        continue;
      }
      // b as a sees it.
      const Pose b = from * ToMotion<kDimension>(edge.measurement.data()) *
                     Inverse(Offset(edge.offset_to));
      if (has_value_[edge.from]) {
        Set(edge.to, PoseAt(edge.from) * b, length);
      } else {
        Set(edge.from, PoseAt(edge.to) * Inverse(b), length);
      }
    }
  }

  PoseGraph& graph_;
  const Eigen::Index num_poses_;
  std::vector<bool> has_value_;  // of the poses, then of the landmarks
  std::vector<std::vector<const PoseGraph::Edge*>> edges_at_;  // of each pose
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue_;
};

}  // namespace

void StartAlongEdges(PoseGraph* graph) {
  if (graph->num_poses_by_edges + graph->num_landmarks_by_edges == 0) return;
  if (graph->dimension == 2) {
    SpanningTree<2>(graph).Grow();
  } else {
    SpanningTree<3>(graph).Grow();
  }
}

}  // namespace invgrad
