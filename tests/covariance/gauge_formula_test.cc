// The gauge-free covariance by hand, from the gauge's own generators:
//
//   C = (J^T J + N N^T)^-1 - N N^T,   N an orthonormal basis of J's null space
//
// of a bundle adjustment and of a pose graph in the plane.

#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Cholesky"
#include "Eigen/Core"
#include "Eigen/Geometry"
#include "Eigen/QR"
#include "ceres/crs_matrix.h"
#include "ceres/problem.h"
#include "gtest/gtest.h"
#include "invgrad/covariance.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/random.h"
#include "invgrad/stored_jacobian.h"
#include "problems/estimation/bundle_adjustment.h"
#include "problems/estimation/pose_graph.h"

namespace invgrad {
namespace gauge_formula_test {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
// Units from pixels to radians: J^T J has a condition number of about 1e12.
using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;

MatrixXd DenseJacobian(ceres::Problem* problem,
                       const std::vector<double*>& blocks) {
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = blocks;
  ceres::CRSMatrix sparse;
  EXPECT_TRUE(problem->Evaluate(options, nullptr, nullptr, nullptr, &sparse));
  MatrixXd J = MatrixXd::Zero(sparse.num_rows, sparse.num_cols);
  for (int i = 0; i < sparse.num_rows; ++i) {
    for (int e = sparse.rows[i]; e < sparse.rows[i + 1]; ++e) {
      J(i, sparse.cols[e]) = sparse.values[e];
    }
  }
  return J;
}

// `motions`: the generators, a column each.
MatrixXd ByHand(const MatrixXd& J, const MatrixXd& motions) {
  EXPECT_LE((J * motions).norm(), 1e-9 * J.norm() * motions.norm());
  const LongMatrix N =
      motions.cast<long double>().householderQr().householderQ() *
      LongMatrix::Identity(motions.rows(), motions.cols());
  const LongMatrix J_long = J.cast<long double>();
  const LongMatrix NNt = N * N.transpose();
  const LongMatrix H = J_long.transpose() * J_long + NNt;
  const LongMatrix inverse =
      H.ldlt().solve(LongMatrix::Identity(J.cols(), J.cols()));
  return (inverse - NNt).cast<double>();
}

// Every pair of blocks by both decompositions. `tolerance`: of the standard
// deviations.
void ExpectByHand(const std::vector<double*>& blocks,
                  const MatrixXd& motions,
                  double tolerance,
                  ceres::Problem* problem) {
  const MatrixXd expected = ByHand(DenseJacobian(problem, blocks), motions);
  const VectorXd deviations = expected.diagonal().cwiseSqrt();
  for (const int max_dense_size : {0, 10000}) {
    Covariance::Options options;
    options.rank.max_dense_size = max_dense_size;
    Covariance covariance;
    std::string error;
    ASSERT_TRUE(ComputeCovariance(options,
                                  *problem,
                                  AllPairs({blocks.begin(), blocks.end()}),
                                  &covariance,
                                  &error))
        << error;
    EXPECT_EQ(covariance.rank(), motions.rows() - motions.cols());
    Index row = 0;
    for (const double* a : blocks) {
      Index column = 0;
      const Index rows = problem->ParameterBlockTangentSize(a);
      for (const double* b : blocks) {
        const Index cols = problem->ParameterBlockTangentSize(b);
        const MatrixXd error_of_block = covariance.TangentBlock(a, b) -
                                        expected.block(row, column, rows, cols);
        const MatrixXd scaled =
            deviations.segment(row, rows).cwiseInverse().asDiagonal() *
            error_of_block *
            deviations.segment(column, cols).cwiseInverse().asDiagonal();
        EXPECT_LE(scaled.cwiseAbs().maxCoeff(), tolerance);
        column += cols;
      }
      row += rows;
    }
  }
}

// The first-order change of a camera's rotation vector w if the world is turned
// by `turn` first: R(w) R(turn)^T = R(w + dw).
Vector3d TurnedCamera(const Vector3d& w, const Vector3d& turn) {
  constexpr double kStep = 1e-6;
  const auto vector = [&](double step) {
    const Eigen::AngleAxisd R(w.norm(), w.normalized());
    const Eigen::AngleAxisd T(-step * turn.norm(), turn.normalized());
    const Eigen::AngleAxisd product(R.toRotationMatrix() *
                                    T.toRotationMatrix());
    return Vector3d(product.angle() * product.axis());
  };
  return (vector(kStep) - vector(-kStep)) / (2.0 * kStep);
}

TEST(GaugeFormula, OfABundleAdjustment) {
  constexpr int kNumCameras = 4;
  constexpr int kNumPoints = 20;
  NumpyRandom random(5);
  BalData data;
  data.cameras.setZero(9, kNumCameras);
  data.points.resize(3, kNumPoints);
  for (int j = 0; j < kNumPoints; ++j) {
    data.points.col(j) = random.Normal(3) + Vector3d(0.0, 0.0, -8.0);
  }
  for (int i = 0; i < kNumCameras; ++i) {
    data.cameras.col(i).head<3>() = 0.2 * random.Normal(3);
    data.cameras.col(i).segment<3>(3) = random.Normal(3);
    data.cameras(6, i) = 500.0;
    data.cameras(7, i) = -0.05;
    data.cameras(8, i) = 0.01;
    for (int j = 0; j < kNumPoints; ++j) {
      const Eigen::VectorXd pixel = random.Normal(2);
      data.observations.push_back({i, j, pixel[0], pixel[1]});
    }
  }
  ceres::Problem problem;
  AddBundleAdjustment([]() { return nullptr; }, &data, &problem);

  std::vector<double*> blocks;
  MatrixXd motions = MatrixXd::Zero(9 * kNumCameras + 3 * kNumPoints, 7);
  // Translations, rotations and scale of the world: X -> X + e, X + e x X,
  // (1 + e) X. A camera sees R X + t.
  for (int i = 0; i < kNumCameras; ++i) {
    auto of_camera = motions.middleRows(9 * i, 9);
    const Vector3d w = data.cameras.col(i).head<3>();
    const Eigen::AngleAxisd R(w.norm(), w.normalized());
    of_camera.block<3, 3>(3, 0) = -R.toRotationMatrix();
    for (int k = 0; k < 3; ++k) {
      of_camera.block<3, 1>(0, 3 + k) = TurnedCamera(w, Vector3d::Unit(k));
    }
    of_camera.block<3, 1>(3, 6) = data.cameras.col(i).segment<3>(3);
    blocks.push_back(data.cameras.col(i).data());
  }
  for (int j = 0; j < kNumPoints; ++j) {
    auto of_point = motions.middleRows(9 * kNumCameras + 3 * j, 3);
    const Vector3d X = data.points.col(j);
    of_point.leftCols<3>().setIdentity();
    for (int k = 0; k < 3; ++k) {
      of_point.col(3 + k) = Vector3d::Unit(k).cross(X);
    }
    of_point.col(6) = X;
    blocks.push_back(data.points.col(j).data());
  }
  // Differences of 1e-6 give the motions to about 1e-10.
  ExpectByHand(blocks, motions, 1e-7, &problem);
}

TEST(GaugeFormula, OfAPoseGraph) {
  constexpr int kNumPoses = 12;
  NumpyRandom random(6);
  PoseGraph graph;
  graph.dimension = 2;
  graph.poses.resize(3, kNumPoses);
  for (int j = 0; j < kNumPoses; ++j) {
    graph.ids.push_back(j);
    graph.poses.col(j) = 2.0 * random.Normal(3);
    for (const int to : {(j + 1) % kNumPoses, (j + 4) % kNumPoses}) {
      PoseGraph::Edge edge;
      edge.from = j;
      edge.to = to;
      edge.measurement = random.Normal(3);
      const Vector3d weights(50.0, 40.0, 300.0);
      edge.information = MatrixXd(weights.asDiagonal());
      graph.edges.push_back(edge);
    }
  }
  ceres::Problem problem;
  AddPoseGraph(
      EdgeError::kG2o, []() { return nullptr; }, &graph, &problem);
  problem.SetParameterBlockVariable(graph.poses.col(0).data());

  std::vector<double*> blocks;
  MatrixXd motions(3 * kNumPoses, 3);
  for (int j = 0; j < kNumPoses; ++j) {
    motions.middleRows(3 * j, 3) << 1.0, 0.0, -graph.poses(1, j), 0.0, 1.0,
        graph.poses(0, j), 0.0, 0.0, 1.0;
    blocks.push_back(graph.poses.col(j).data());
  }
  ExpectByHand(blocks, motions, 1e-10, &problem);
}

}  // namespace gauge_formula_test
}  // namespace invgrad
