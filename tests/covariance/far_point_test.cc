// A bundle adjustment with three control points, eleven tie points of which one
// has drifted far away (a weak direction), and a point that one camera sees
// alone (an undetermined one). The cameras are determined: their covariance is
// compared with an inverse of higher precision, which has no such point.
#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/QR"
#include "ceres/autodiff_cost_function.h"
#include "ceres/crs_matrix.h"
#include "ceres/problem.h"
#include "ceres/rotation.h"
#include "gtest/gtest.h"
#include "invgrad/covariance.h"
#include "invgrad/random.h"

namespace invgrad {
namespace far_point_test {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// The image of a point, in pixels.
struct Image {
  template <typename T>
  bool operator()(const T* camera, const T* point, T* r) const {
    T p[3];
    ceres::AngleAxisRotatePoint(camera, point, p);
    for (int i = 0; i < 3; ++i) p[i] += camera[3 + i];
    r[0] = 1000.0 * p[0] / p[2];
    r[1] = 1000.0 * p[1] / p[2];
    return true;
  }
};

constexpr int kNumCameras = 4;

class Scene {
 public:
  Scene(double far, bool has_single) {
    NumpyRandom random(5);
    for (int c = 0; c < kNumCameras; ++c) {
      Vector6d camera;
      camera << 0.02 * c, 0.1 * (c - 1.5), 0.03 * c, 5.0 * c - 7.5,
          1.0 * (c % 2), 0.5 * c;
      cameras_.push_back(camera);
    }
    for (int p = 0; p < 14; ++p) {
      points_.push_back({random.Uniform(-10.0, 10.0),
                         random.Uniform(-10.0, 10.0),
                         random.Uniform(30.0, 50.0)});
    }
    points_.back() = far * Vector3d(0.1, 0.2, 1.0);
    points_.push_back({3.0, 4.0, 40.0});  // seen once
    for (std::size_t p = 0; p < points_.size(); ++p) {
      const bool is_single = p + 1 == points_.size();
      if (is_single && !has_single) continue;
      for (int c = 0; c < (is_single ? 1 : kNumCameras); ++c) {
        problem_.AddResidualBlock(
            new ceres::AutoDiffCostFunction<Image, 2, 6, 3>(new Image),
            nullptr,
            cameras_[c].data(),
            points_[p].data());
      }
      if (p < 3) problem_.SetParameterBlockConstant(points_[p].data());
    }
  }

  ceres::Problem& problem() { return problem_; }
  std::vector<const double*> cameras() const {
    std::vector<const double*> blocks;
    for (const Vector6d& camera : cameras_) blocks.push_back(camera.data());
    return blocks;
  }
  Covariance Compute(double threshold, int max_dense_size = 300) const {
    Covariance::Options options;
    options.rank.threshold = threshold;
    options.rank.max_dense_size = max_dense_size;
    Covariance covariance;
    std::string error;
    EXPECT_TRUE(ComputeCovariance(
        options, problem_, MarginalPairs(problem_), &covariance, &error))
        << error;
    return covariance;
  }

 private:
  std::vector<Vector6d> cameras_;
  std::vector<Vector3d> points_;
  ceres::Problem problem_;
};

// The standard deviations of the cameras by a QR decomposition.
VectorXd CamerasByQr(double far) {
  Scene scene(far, /*has_single=*/false);
  ceres::Problem::EvaluateOptions options;
  for (const double* camera : scene.cameras()) {
    options.parameter_blocks.push_back(const_cast<double*>(camera));
  }
  std::vector<double*> blocks;
  scene.problem().GetParameterBlocks(&blocks);
  for (double* block : blocks) {
    if (scene.problem().ParameterBlockSize(block) == 3 &&
        !scene.problem().IsParameterBlockConstant(block)) {
      options.parameter_blocks.push_back(block);
    }
  }
  ceres::CRSMatrix sparse;
  EXPECT_TRUE(
      scene.problem().Evaluate(options, nullptr, nullptr, nullptr, &sparse));
  LongMatrix J = LongMatrix::Zero(sparse.num_rows, sparse.num_cols);
  for (int i = 0; i < sparse.num_rows; ++i) {
    for (int e = sparse.rows[i]; e < sparse.rows[i + 1]; ++e) {
      J(i, sparse.cols[e]) = sparse.values[e];
    }
  }
  const LongMatrix scales =
      J.colwise().norm().cwiseInverse().transpose().eval();
  const LongMatrix A = J * scales.col(0).asDiagonal();
  const Eigen::HouseholderQR<LongMatrix> qr(A);
  const LongMatrix R = qr.matrixQR().topRows(A.cols());
  const LongMatrix inverse = R.triangularView<Eigen::Upper>().solve(
      LongMatrix::Identity(A.cols(), A.cols()));
  return (scales.col(0).asDiagonal() * inverse)
      .rowwise()
      .norm()
      .head(6 * kNumCameras)
      .cast<double>();
}

VectorXd OfCameras(const Scene& scene,
                   const Covariance& covariance,
                   VectorXd Covariance::Block::*member) {
  VectorXd all(6 * kNumCameras);
  for (int c = 0; c < kNumCameras; ++c) {
    all.segment<6>(6 * c) = covariance.block(scene.cameras()[c]).*member;
  }
  return all;
}

double LargestError(const VectorXd& a, const VectorXd& b) {
  return (a.cwiseQuotient(b).array() - 1.0).abs().maxCoeff();
}

TEST(FarPoint, LeavesTheDeviationsOfTheCamerasAsTheyAre) {
  for (const double far : {1e3, 1e5, 1e6, 5e6}) {
    SCOPED_TRACE(far);
    const VectorXd expected = CamerasByQr(far);
    const Scene scene(far, true);
    // s / s_max is between 1e-8 and 1e-3.
    const Covariance dense = scene.Compute(1e-9);
    EXPECT_EQ(dense.num_parameters() - dense.rank(), 1);
    EXPECT_LE(
        LargestError(
            OfCameras(scene, dense, &Covariance::Block::standard_deviations),
            expected),
        1e-15 * far);
    EXPECT_EQ(OfCameras(scene, dense, &Covariance::Block::undetermined_shares)
                  .maxCoeff(),
              0.0);
  }
}

TEST(FarPoint, TheReportSaysWhatTheThresholdOfTheRankMatters) {
  const Scene scene(5e6, true);
  const Covariance kept = scene.Compute(1e-9);
  const Covariance omitted = scene.Compute(1e-6);
  EXPECT_EQ(kept.rank() - omitted.rank(), 1);
  const auto of = [&scene](const Covariance& covariance,
                           VectorXd Covariance::Block::*member) {
    return OfCameras(scene, covariance, member);
  };
  const VectorXd kept_variances =
      of(kept, &Covariance::Block::standard_deviations).cwiseAbs2();
  const VectorXd omitted_variances =
      of(omitted, &Covariance::Block::standard_deviations).cwiseAbs2();
  const VectorXd weak = of(kept, &Covariance::Block::weak_variances);
  EXPECT_LE(LargestError(kept_variances - weak, omitted_variances), 1e-5);
  // Of parameters that are determined without the direction, too.
  const VectorXd more = of(omitted, &Covariance::Block::omitted_variances);
  const VectorXd shares = of(omitted, &Covariance::Block::undetermined_shares);
  int num_determined = 0;
  for (Eigen::Index i = 0; i < more.size(); ++i) {
    if (shares[i] > 0.0) continue;
    ++num_determined;
    EXPECT_NEAR(
        (omitted_variances[i] + more[i]) / kept_variances[i], 1.0, 1e-5);
  }
  EXPECT_GE(num_determined, 12);
  EXPECT_GT(more.cwiseQuotient(omitted_variances).maxCoeff(), 0.01);
  // Not known of a sparse group.
  const Covariance sparse = scene.Compute(1e-9, 0);
  for (const auto member : {&Covariance::Block::weak_variances,
                            &Covariance::Block::omitted_variances}) {
    EXPECT_TRUE(of(sparse, member).array().isNaN().all());
  }
  EXPECT_NE(kept.ToText().find("of the variance from weak directions"),
            std::string::npos)
      << kept.ToText();
  EXPECT_NE(omitted.ToText().find(
                "more variance with the directions below the threshold"),
            std::string::npos)
      << omitted.ToText();
}

}  // namespace far_point_test
}  // namespace invgrad
