#include <cmath>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "Eigen/Eigenvalues"
#include "fmt/core.h"
#include "problems/estimation/chordal_relaxation.h"
#include "problems/estimation/estimation.h"
#include "problems/estimation/pose_graph.h"

namespace invgrad {
namespace {

// Longer lines are drawn as several series, because long series are thinned.
constexpr size_t kMaxPointsOfSeries = 6000;

constexpr int kNumEllipses = 100;
constexpr int kNumEllipsePoints = 40;

class PoseGraphEstimation final : public Estimation {
 public:
  PoseGraphEstimation(EstimationTraits traits,
                      const PoseGraph& graph,
                      EdgeError edge_error)
      : Estimation(std::move(traits)),
        start_(graph),
        graph_(graph),
        edge_error_(edge_error) {}

  void SetStart(int /*start*/) override { graph_ = start_; }

  void Perturb(double sigma, NumpyRandom* random) override {
    PerturbPoseGraph(sigma, random, &graph_);
  }

  std::unique_ptr<ceres::Problem> MakeProblem(
      const MakeLossFunction& make_loss) override {
    auto problem = std::make_unique<ceres::Problem>();
    AddPoseGraph(edge_error_, make_loss, &graph_, problem.get());
    return problem;
  }

  bool Relax() override { return RelaxChordally(&graph_); }

  // With the id of the file: of 2D "pose 7"; of 3D "pose 7" for its position,
  // and "orientation 7"; "landmark 7".
  std::string BlockName(const double* values) const override {
    const Eigen::Index offset = values - graph_.poses.data();
    const Eigen::Index size = graph_.poses.rows();
    if (!IsInPoses(values)) {
      const Eigen::Index of_landmarks = values - graph_.landmarks.data();
      return fmt::format(
          "landmark {}",
          graph_.landmark_ids[of_landmarks / graph_.landmarks.rows()]);
    }
    return fmt::format("{} {}",
                       offset % size == 0 ? "pose" : "orientation",
                       graph_.ids[offset / size]);
  }

  // Steps on the manifold change a quaternion's length by rounding errors.
  bool Write(const std::string& path, std::string* error) const override {
    PoseGraph graph = graph_;
    if (graph.dimension == 3) {
      graph.poses.bottomRows<4>().colwise().normalize();
    }
    return WriteG2oFile(path, graph, error);
  }

  void Draw(const std::string& label,
            std::vector<Plot>* panels) const override {
    Plot plot = Panel(label);
    AddEdges("other edges", /*consecutive=*/false, /*color=*/1, &plot);
    AddEdges("to the next pose", /*consecutive=*/true, /*color=*/0, &plot);
    AddLandmarks(&plot);
    panels->push_back(std::move(plot));
  }

  void DrawCovariance(const std::string& label,
                      const Covariance& covariance,
                      std::vector<Plot>* panels) const override {
    Plot plot = Panel(label);
    AddEdges("to the next pose", /*consecutive=*/true, /*color=*/0, &plot);
    AddEllipses(covariance, &plot);
    panels->push_back(std::move(plot));
  }

 private:
  bool IsInPoses(const double* values) const {
    const double* poses = graph_.poses.data();
    return std::less_equal<>()(poses, values) &&
           std::less<>()(values, poses + graph_.poses.size());
  }

  Plot Panel(const std::string& title) const {
    Plot plot;
    plot.title = title;
    plot.x_label = graph_.dimension == 2 ? "x" : "(x - y) / sqrt 2";
    plot.y_label = graph_.dimension == 2 ? "y" : "(2 z - x - y) / sqrt 6";
    plot.equal_aspect = true;
    return plot;
  }

  // From a position to the picture: the top view; of a 3D graph the
  // orthographic view from (1, 1, 1).
  Eigen::Matrix2Xd Projection() const {
    Eigen::Matrix2Xd projection(2, graph_.dimension);
    if (graph_.dimension == 2) {
      projection.setIdentity();
    } else {
      projection << 1.0, -1.0, 0.0, -1.0, -1.0, 2.0;
      projection.rowwise().normalize();
    }
    return projection;
  }

  Eigen::Vector2d Project(Eigen::Index j) const {
    return Projection() * graph_.poses.col(j).head(graph_.dimension);
  }

  // Two standard deviations of at most kNumEllipses positions, evenly spaced.
  void AddEllipses(const Covariance& covariance, Plot* plot) const {
    constexpr double kGap = std::numeric_limits<double>::quiet_NaN();
    Series ellipses;
    ellipses.title = "two standard deviations";
    ellipses.color = 3;
    const Eigen::Index stride = (graph_.poses.cols() - 1) / kNumEllipses + 1;
    for (const Covariance::Block& block : covariance.blocks()) {
      const double* pose = block.block.values;
      if (!IsInPoses(pose)) continue;
      const Eigen::Index offset = pose - graph_.poses.data();
      const Eigen::Index j = offset / graph_.poses.rows();
      const bool is_position = offset % graph_.poses.rows() == 0;
      if (!is_position || j % stride != 0) continue;
      const Eigen::MatrixXd C =
          covariance.TangentBlock(pose, pose)
              .topLeftCorner(graph_.dimension, graph_.dimension);
      const Eigen::Matrix2d projected =
          Projection() * C * Projection().transpose();
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(projected);
      const Eigen::Matrix2d axes =
          2.0 * eigen.eigenvectors() *
          eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
      for (int i = 0; i <= kNumEllipsePoints; ++i) {
        const double angle = 2.0 * EIGEN_PI * i / kNumEllipsePoints;
        const Eigen::Vector2d point =
            Project(j) +
            axes * Eigen::Vector2d(std::cos(angle), std::sin(angle));
        ellipses.x.push_back(point[0]);
        ellipses.y.push_back(point[1]);
      }
      ellipses.x.push_back(kGap);
      ellipses.y.push_back(kGap);
    }
    plot->series.push_back(std::move(ellipses));
  }

  void AddLandmarks(Plot* plot) const {
    if (graph_.landmarks.cols() == 0) return;
    Series points;
    points.title = "landmarks";
    points.style = Series::Style::kPoints;
    points.color = 2;
    const Eigen::Matrix2Xd projected = Projection() * graph_.landmarks;
    points.x.assign(projected.row(0).begin(), projected.row(0).end());
    points.y.assign(projected.row(1).begin(), projected.row(1).end());
    plot->series.push_back(std::move(points));
  }

  // The edges between successive poses, or the other edges.
  void AddEdges(const std::string& title,
                bool consecutive,
                int color,
                Plot* plot) const {
    Series lines;
    lines.title = title;
    lines.color = color;
    const auto flush = [&lines, plot]() {
      if (!lines.x.empty()) plot->series.push_back(lines);
      lines.title.clear();  // once in the legend
      lines.x.clear();
      lines.y.clear();
    };
    constexpr double kGap = std::numeric_limits<double>::quiet_NaN();
    for (const PoseGraph::Edge& edge : graph_.edges) {
      if (edge.kind != PoseGraph::EdgeKind::kRelative ||
          (edge.to == edge.from + 1) != consecutive) {
        continue;
      }
      if (lines.x.size() + 3 > kMaxPointsOfSeries) flush();
      const Eigen::Vector2d a = Project(edge.from);
      const Eigen::Vector2d b = Project(edge.to);
      for (const Eigen::Vector2d& point : {a, b, Eigen::Vector2d(kGap, kGap)}) {
        lines.x.push_back(point[0]);
        lines.y.push_back(point[1]);
      }
    }
    flush();
  }

  const PoseGraph start_;
  PoseGraph graph_;
  const EdgeError edge_error_;
};

std::string Description(const PoseGraph& graph) {
  std::string text = fmt::format("{} poses, ", graph.poses.cols());
  if (graph.landmarks.cols() > 0) {
    text += fmt::format("{} landmarks, ", graph.landmarks.cols());
  }
  text += fmt::format("{} edges, {}D", graph.edges.size(), graph.dimension);
  const int num_starts =
      graph.num_poses_by_edges + graph.num_landmarks_by_edges;
  if (num_starts > 0) {
    text += fmt::format(
        "; {} without a VERTEX line start along a spanning tree of the edges",
        num_starts);
  }
  return text;
}

}  // namespace

std::unique_ptr<Estimation> ReadPoseGraphEstimation(
    const std::string& path,
    const ReadEstimationOptions& options,
    std::string* error) {
  PoseGraph graph;
  if (!ReadG2oFile(path, &graph, error)) return nullptr;
  if (graph.edges.empty()) {
    *error = path + ": no edges; expected poses and the edges between them";
    return nullptr;
  }
  std::string why;
  if (!HasEdgeError(graph, options.edge_error, &why)) {
    *error = path + ": " + why;
    return nullptr;
  }
  EstimationTraits traits;
  traits.description = Description(graph);
  traits.linear_solver = "sparse_normal_cholesky";
  traits.extension = ".g2o";
  traits.budget.max_num_iterations = 200;
  // Ceres does not take the last step. One that lowers the cost by 1e-9 of it is
  // some 3e-5 standard deviations long; by Ceres' 1e-6, 1e-3.
  traits.budget.function_tolerance = 1e-9;
  traits.has_unit_variance = true;
  return std::make_unique<PoseGraphEstimation>(
      traits, graph, options.edge_error);
}

}  // namespace invgrad
