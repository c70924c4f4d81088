#include "problems/estimation/chordal_relaxation.h"

#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/LU"
#include "Eigen/SVD"
#include "Eigen/SparseCore"
#include "invgrad/core/union_find.h"
#include "invgrad/covariance/sparse_cholesky.h"
#include "problems/estimation/motion.h"
#include "problems/estimation/pose_graph.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Edge = PoseGraph::Edge;
using EdgeKind = PoseGraph::EdgeKind;

// weight |A X_from + b - X_to|^2; from = -1: weight |b - X_to|^2.
struct LinearEdge {
  double weight;
  Index from;
  MatrixXd A;
  MatrixXd b;
  Index to;
};

// Whether edges of positive weight connect all blocks with a fixed one or with
// the world, which is the first element; block k is element k + 1.
bool AreAllConnected(const std::vector<LinearEdge>& edges,
                     const std::vector<bool>& is_fixed) {
  UnionFind elements(is_fixed.size() + 1);
  const auto join = [&elements](Index a, Index b) {
    elements.Join(static_cast<int>(a) + 1, static_cast<int>(b) + 1);
  };
  const auto num_blocks = static_cast<Index>(is_fixed.size());
  for (Index k = 0; k < num_blocks; ++k) {
    if (is_fixed[k]) join(-1, k);
  }
  for (const LinearEdge& edge : edges) {
    if (edge.weight > 0.0) join(edge.from, edge.to);
  }
  for (Index k = 0; k < num_blocks; ++k) {
    if (elements.Find(static_cast<int>(k) + 1) != 0) return false;
  }
  return true;
}

// Minimizes the sum over the edges in the blocks X that are not fixed. Returns
// false if the minimum is not unique or not finite.
bool MinimizeEdges(const std::vector<LinearEdge>& edges,
                   const std::vector<bool>& is_fixed,
                   std::vector<MatrixXd>* X) {
  if (!AreAllConnected(edges, is_fixed)) return false;
  const Index size = X->front().rows();
  std::vector<Index> columns(X->size(), -1);
  Index num_columns = 0;
  for (std::size_t k = 0; k < X->size(); ++k) {
    if (is_fixed[k]) continue;
    columns[k] = num_columns;
    num_columns += size;
  }
  if (num_columns == 0) return true;
  const MatrixXd minus_one = -MatrixXd::Identity(size, size);
  const auto num_rows = static_cast<Index>(edges.size()) * size;
  MatrixXd rhs(num_rows, X->front().cols());
  std::vector<Eigen::Triplet<double>> entries;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const LinearEdge& edge = edges[e];
    const double root = std::sqrt(edge.weight);
    const Index row = static_cast<Index>(e) * size;
    rhs.middleRows(row, size) = -root * edge.b;
    const auto add = [&](Index block, const MatrixXd& factor) {
      if (columns[block] < 0) {
        rhs.middleRows(row, size) -= root * factor * (*X)[block];
        return;
      }
      for (Index i = 0; i < size; ++i) {
        for (Index j = 0; j < size; ++j) {
          entries.emplace_back(
              row + i, columns[block] + j, root * factor(i, j));
        }
      }
    };
    if (edge.from >= 0) add(edge.from, edge.A);
    add(edge.to, minus_one);
  }
  Eigen::SparseMatrix<double> A(num_rows, num_columns);
  A.setFromTriplets(entries.begin(), entries.end());
  SparseCholesky cholesky;
  std::string ignored;
  if (!cholesky.Factorize(A, &ignored)) return false;
  const MatrixXd solution = cholesky.Solve(A.transpose() * rhs);
  if (!solution.allFinite()) return false;
  for (std::size_t k = 0; k < X->size(); ++k) {
    if (!is_fixed[k]) (*X)[k] = solution.middleRows(columns[k], size);
  }
  return true;
}

template <int kDimension>
class Relaxation {
 public:
  explicit Relaxation(PoseGraph* graph)
      : graph_(*graph), is_fixed_(graph->poses.cols(), false) {
    for (const int pose : ConstantPoses(*graph)) is_fixed_[pose] = true;
  }

  bool Run() {
    std::vector<MatrixXd> rotations;  // transposed
    std::vector<MatrixXd> positions;  // rows
    for (Index j = 0; j < graph_.poses.cols(); ++j) {
      const Pose pose = ToMotion<kDimension>(graph_.poses.col(j).data());
      rotations.push_back(Transposed(pose.rotation));
      positions.push_back(pose.translation.transpose());
    }
    if (!MinimizeEdges(RotationEdges(), is_fixed_, &rotations)) return false;
    for (std::size_t j = 0; j < rotations.size(); ++j) {
      if (!is_fixed_[j]) rotations[j] = NearestRotation(rotations[j]);
    }
    if (!MinimizeEdges(PositionEdges(rotations), is_fixed_, &positions)) {
      return false;
    }
    for (std::size_t j = 0; j < rotations.size(); ++j) {
      if (is_fixed_[j]) continue;
      Pose pose;
      const Matrix R = rotations[j].transpose();
      pose.rotation = typename Pose::Rotation(R);
      pose.translation = positions[j].transpose();
      graph_.poses.col(static_cast<Index>(j)) = ToPose(pose);
    }
    PlaceLandmarks();
    return true;
  }

 private:
  using Pose = Motion<double, kDimension>;
  using Matrix = Eigen::Matrix<double, kDimension, kDimension>;

  static MatrixXd Transposed(const typename Pose::Rotation& rotation) {
    return rotation.toRotationMatrix().transpose();
  }

  static MatrixXd NearestRotation(const MatrixXd& matrix) {
    const Eigen::JacobiSVD<MatrixXd> svd(
        matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
    MatrixXd U = svd.matrixU();
    if ((U * svd.matrixV().transpose()).determinant() < 0.0) {
      U.rightCols<1>() *= -1.0;
    }
    return U * svd.matrixV().transpose();
  }

  // Of the pose `to` in the frame of the pose `from`; of a prior, in the world.
  Pose Measurement(const Edge& edge) const {
    const Pose Z = ToMotion<kDimension>(edge.measurement.data());
    const Pose from = OffsetMotion<kDimension>(graph_, edge.offset_from);
    if (edge.kind == EdgeKind::kPrior) return Z * Inverse(from);
    const Pose to = OffsetMotion<kDimension>(graph_, edge.offset_to);
    return from * Z * Inverse(to);
  }

  // make(edge, measurement): its weight, A and b.
  template <typename Make>
  std::vector<LinearEdge> LinearEdges(const Make& make) const {
    std::vector<LinearEdge> edges;
    for (const Edge& edge : graph_.edges) {
      if (edge.kind == EdgeKind::kLandmark) continue;
      edges.push_back(make(edge, Measurement(edge)));
      const bool is_prior = edge.kind == EdgeKind::kPrior;
      edges.back().from = is_prior ? -1 : edge.from;
      edges.back().to = is_prior ? edge.from : edge.to;
    }
    return edges;
  }

  // R_j^T = Z^T R_i^T; of a prior R_j^T = Z^T.
  std::vector<LinearEdge> RotationEdges() const {
    return LinearEdges([](const Edge& edge, const Pose& measurement) {
      const Index num_angles = edge.information.rows() - kDimension;
      LinearEdge linear;
      linear.weight = edge.information.diagonal().tail(num_angles).mean();
      linear.A = Transposed(measurement.rotation);
      linear.b = edge.kind == EdgeKind::kPrior
                     ? linear.A
                     : MatrixXd(MatrixXd::Zero(kDimension, kDimension));
      return linear;
    });
  }

  // t_j = t_i + R_i z; of a prior t_j = z.
  std::vector<LinearEdge> PositionEdges(
      const std::vector<MatrixXd>& rotations) const {
    return LinearEdges([&](const Edge& edge, const Pose& measurement) {
      LinearEdge linear;
      linear.weight =
          edge.information.diagonal().template head<kDimension>().mean();
      linear.A = MatrixXd::Identity(1, 1);
      linear.b = measurement.translation.transpose();
      if (edge.kind != EdgeKind::kPrior) linear.b *= rotations[edge.from];
      return linear;
    });
  }

  void PlaceLandmarks() {
    MatrixXd sums = MatrixXd::Zero(kDimension, graph_.landmarks.cols());
    Eigen::VectorXd counts = Eigen::VectorXd::Zero(graph_.landmarks.cols());
    for (const Edge& edge : graph_.edges) {
      if (edge.kind != EdgeKind::kLandmark) continue;
      const Pose sensor =
          ToMotion<kDimension>(graph_.poses.col(edge.from).data()) *
          OffsetMotion<kDimension>(graph_, edge.offset_from);
      sums.col(edge.to) += sensor * typename Pose::Point(edge.measurement);
      counts[edge.to] += 1.0;
    }
    for (const int landmark : graph_.fixed_landmarks) counts[landmark] = 0.0;
    for (Index k = 0; k < counts.size(); ++k) {
      if (counts[k] > 0.0) graph_.landmarks.col(k) = sums.col(k) / counts[k];
    }
  }

  PoseGraph& graph_;
  std::vector<bool> is_fixed_;
};

}  // namespace

bool RelaxChordally(PoseGraph* graph) {
  return graph->dimension == 2 ? Relaxation<2>(graph).Run()
                               : Relaxation<3>(graph).Run();
}

}  // namespace invgrad
