#include <cmath>
#include <limits>
#include <utility>

#include "fmt/core.h"
#include "problems/estimation/estimation.h"
#include "problems/estimation/g2o_file.h"
#include "problems/estimation/pose_graph.h"

namespace invgrad {

namespace {

// Longer lines are drawn as several series, because long series are thinned.
constexpr size_t kMaxPointsOfSeries = 6000;

class PoseGraphEstimation final : public Estimation {
 public:
  PoseGraphEstimation(PoseGraph graph, InformationRoot root)
      : start_(std::move(graph)), graph_(start_), root_(root) {}

  std::string Description() const override {
    return fmt::format("{} poses, {} edges, {}D",
                       graph_.poses.cols(),
                       graph_.edges.size(),
                       graph_.dimension);
  }

  void SetStart(int /*start*/) override { graph_ = start_; }

  void Perturb(double sigma, NumpyRandom* random) override {
    PerturbPoseGraph(sigma, random, &graph_);
  }

  std::unique_ptr<ceres::Problem> MakeProblem(
      const MakeLossFunction& make_loss) override {
    auto problem = std::make_unique<ceres::Problem>();
    AddPoseGraph(root_, make_loss, &graph_, problem.get());
    return problem;
  }

  void SetBudget(MinimizerOptions* options) const override {
    *options = MinimizerOptions();
    options->max_num_iterations = 200;
  }

  std::string LinearSolver() const override { return "sparse_normal_cholesky"; }

  std::string Extension() const override { return ".g2o"; }

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
    Plot plot;
    plot.title = label;
    plot.x_label = graph_.dimension == 2 ? "x" : "(x - y) / sqrt 2";
    plot.y_label = graph_.dimension == 2 ? "y" : "(2 z - x - y) / sqrt 6";
    plot.equal_aspect = true;
    AddEdges("other edges", /*consecutive=*/false, /*color=*/1, &plot);
    AddEdges("to the next pose", /*consecutive=*/true, /*color=*/0, &plot);
    panels->push_back(std::move(plot));
  }

 private:
  // Top view; of a 3D graph the orthographic view from (1, 1, 1).
  Eigen::Vector2d Project(int j) const {
    const auto pose = graph_.poses.col(j);
    if (graph_.dimension == 2) return pose.head<2>();
    return {(pose[0] - pose[1]) / std::sqrt(2.0),
            (2.0 * pose[2] - pose[0] - pose[1]) / std::sqrt(6.0)};
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
      if ((edge.to == edge.from + 1) != consecutive) continue;
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
  const InformationRoot root_;
};

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
  return std::make_unique<PoseGraphEstimation>(std::move(graph),
                                               options.information_root);
}

}  // namespace invgrad
