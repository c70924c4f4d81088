// Problems whose undetermined directions are known, for tests of the rank
// report.
#ifndef INVGRAD_TESTS_RANK_PROBLEMS_H_
#define INVGRAD_TESTS_RANK_PROBLEMS_H_

#include <algorithm>
#include <array>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "Eigen/Geometry"
#include "ceres/autodiff_cost_function.h"
#include "ceres/cost_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/rotation.h"
#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "invgrad/rank/decompositions.h"
#include "invgrad/rank_report.h"

namespace invgrad {

// r = sum_b A_b x_b: a Jacobian of any entries.
class Linear final : public ceres::CostFunction {
 public:
  explicit Linear(std::vector<Eigen::MatrixXd> A) : A_(std::move(A)) {
    set_num_residuals(static_cast<int>(A_[0].rows()));
    for (const Eigen::MatrixXd& A_b : A_) {
      mutable_parameter_block_sizes()->push_back(static_cast<int>(A_b.cols()));
    }
  }

  bool Evaluate(double const* const* x,
                double* r,
                double** jacobians) const override {
    Eigen::Map<Eigen::VectorXd> residuals(r, num_residuals());
    residuals.setZero();
    for (std::size_t b = 0; b < A_.size(); ++b) {
      residuals +=
          A_[b] * Eigen::Map<const Eigen::VectorXd>(x[b], A_[b].cols());
      if (jacobians != nullptr && jacobians[b] != nullptr) {
        Eigen::Map<Eigen::Matrix<double,
                                 Eigen::Dynamic,
                                 Eigen::Dynamic,
                                 Eigen::RowMajor>>(
            jacobians[b], A_[b].rows(), A_[b].cols()) = A_[b];
      }
    }
    return true;
  }

 private:
  const std::vector<Eigen::MatrixXd> A_;
};

inline Eigen::MatrixXd Row(std::initializer_list<double> entries) {
  Eigen::MatrixXd row(1, entries.size());
  std::copy(entries.begin(), entries.end(), row.data());
  return row;
}

inline RankReport Report(const ceres::Problem& problem,
                         const RankReport::Options& options = {}) {
  RankReport report;
  std::string error;
  EXPECT_TRUE(ComputeRankReport(options, problem, &report, &error)) << error;
  return report;
}

// Every undetermined direction has a singular value below the threshold, and
// they are independent.
inline void ExpectConsistent(const ceres::Problem& problem,
                             const RankReport& report) {
  int num_unused = 0;
  for (const auto& unused : report.unused) {
    num_unused += static_cast<int>(unused.tangent.size());
  }
  EXPECT_EQ(report.num_undetermined(),
            num_unused + static_cast<int>(report.undetermined.size()));
  Eigen::MatrixXd steps(report.num_parameters, report.undetermined.size());
  for (std::size_t d = 0; d < report.undetermined.size(); ++d) {
    const RankReport::Direction& direction = report.undetermined[d];
    EXPECT_LE(direction.singular_value, 1e-7);
    double share = 0.0;
    for (const RankReport::Part& part : direction.parts) share += part.share;
    // Parts below 1e-5 are left out.
    EXPECT_NEAR(share, 1.0, 1e-9 * (1.0 + report.blocks.size()));
    steps.col(static_cast<Eigen::Index>(d)) =
        report.Step(direction).normalized();
  }
  if (steps.cols() > 0) {
    EXPECT_GT(ComputeRightSvd(steps).s.minCoeff(), 1e-12);
  }
  EXPECT_EQ(report.blocks.size() + report.num_constant_blocks,
            static_cast<std::size_t>(problem.NumParameterBlocks()));
}

using Names = std::vector<std::string>;

// Of all undetermined directions, which are of one gauge, "" for no name.
inline Names NamesOf(const ceres::Problem& problem,
                     const RankReport::Options& options = {}) {
  const RankReport report = Report(problem, options);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.gauges.size(), 1u) << report.ToText();
  Names names;
  for (const RankReport::Direction& direction : report.undetermined) {
    EXPECT_FALSE(direction.gauge.empty());
    names.push_back(direction.generator);
  }
  return names;
}

inline void AddPrior(const Eigen::MatrixXd& A,
                     double* x,
                     ceres::Problem* problem) {
  problem->AddResidualBlock(new Linear({A}), nullptr, x);
}

// Poses in the plane.

// (x, y, angle) of b as a sees it, less a measurement; the angle in units of
// 1 / kAngleUnit radians.
struct Between2 {
  template <typename T>
  bool operator()(const T* a, const T* b, T* r) const {
    using std::cos;
    using std::sin;
    const T dx = b[0] - a[0];
    const T dy = b[1] - a[1];
    const T angle = a[2] / unit;
    r[0] = cos(angle) * dx + sin(angle) * dy - 1.0;
    r[1] = -sin(angle) * dx + cos(angle) * dy - 0.2;
    r[2] = (b[2] - a[2]) / unit - 0.3;
    return true;
  }
  double unit = 1.0;
};

// The same of six blocks of size 1.
struct SplitBetween2 {
  template <typename T>
  bool operator()(const T* xa,
                  const T* ya,
                  const T* ta,
                  const T* xb,
                  const T* yb,
                  const T* tb,
                  T* r) const {
    const T a[3] = {*xa, *ya, *ta};
    const T b[3] = {*xb, *yb, *tb};
    return Between2()(a, b, r);
  }
};

struct Graph2 {
  Graph2(int size, double unit, ceres::Problem* problem) : poses(size) {
    NumpyRandom random(3);
    for (int i = 0; i < size; ++i) {
      poses[i] = {random.Uniform(-5.0, 5.0),
                  random.Uniform(-5.0, 5.0),
                  unit * random.Uniform(-3.0, 3.0)};
    }
    for (int i = 0; i < size; ++i) {
      for (const int j : {i + 1, i + 7}) {
        if (j >= size) continue;
        problem->AddResidualBlock(
            new ceres::AutoDiffCostFunction<Between2, 3, 3, 3>(
                new Between2{unit}),
            nullptr,
            poses[i].data(),
            poses[j].data());
      }
    }
  }
  std::vector<std::array<double, 3>> poses;
};

// Poses in space.

struct Between3 {
  template <typename T>
  bool operator()(
      const T* pa, const T* qa, const T* pb, const T* qb, T* r) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Vector> a(pa);
    const Eigen::Map<const Vector> b(pb);
    const Eigen::Map<const Eigen::Quaternion<T>> Qa(qa);
    const Eigen::Map<const Eigen::Quaternion<T>> Qb(qb);
    Eigen::Map<Vector>(r + 0) = Qa.conjugate() * (b - a);
    Eigen::Map<Vector>(r + 3) = T(2.0) * (Qa.conjugate() * Qb).vec();
    r[0] -= T(1.0);
    return true;
  }
};

struct Graph3 {
  Graph3(int size, ceres::Problem* problem) : p(size), q(size) {
    NumpyRandom random(5);
    for (int i = 0; i < size; ++i) {
      for (double& entry : p[i]) entry = random.Uniform(-3.0, 3.0);
      // A smooth path, so that no edge turns by half a circle.
      const Eigen::Quaterniond turn(Eigen::AngleAxisd(
          0.3 * i, Eigen::Vector3d(1.0, 0.5, -0.3).normalized()));
      Eigen::Map<Eigen::Vector4d>{q[i].data()} = turn.coeffs();
      problem->AddParameterBlock(
          q[i].data(), 4, new ceres::EigenQuaternionManifold);
    }
    for (int i = 0; i < size; ++i) {
      for (const int j : {i + 1, i + 3}) {
        if (j >= size) continue;
        problem->AddResidualBlock(
            new ceres::AutoDiffCostFunction<Between3, 6, 3, 4, 3, 4>(
                new Between3),
            nullptr,
            p[i].data(),
            q[i].data(),
            p[j].data(),
            q[j].data());
      }
    }
  }
  std::vector<std::array<double, 3>> p;
  std::vector<std::array<double, 4>> q;
};

// Bundle adjustment.

// BAL's camera: angle axis, translation, focal length, two distortions.
struct Reprojection {
  template <typename T>
  bool operator()(const T* camera, const T* point, T* r) const {
    T p[3];
    ceres::AngleAxisRotatePoint(camera, point, p);
    for (int i = 0; i < 3; ++i) p[i] += camera[3 + i];
    const T u = -p[0] / p[2];
    const T v = -p[1] / p[2];
    const T s = u * u + v * v;
    const T scale = camera[6] * (1.0 + s * (camera[7] + s * camera[8]));
    r[0] = scale * u - 0.1;
    r[1] = scale * v + 0.2;
    return true;
  }
};

// The same with rotation, translation and point as blocks, focal length 1.
struct QuaternionReprojection {
  template <typename T>
  bool operator()(const T* q, const T* t, const T* point, T* r) const {
    T p[3];
    ceres::QuaternionRotatePoint(q, point, p);
    r[0] = (p[0] + t[0]) / (p[2] + t[2]);
    r[1] = (p[1] + t[1]) / (p[2] + t[2]);
    return true;
  }
};

struct Scene {
  Scene(int num_cameras, int num_points)
      : cameras(num_cameras), q(num_cameras), points(num_points) {
    NumpyRandom random(11);
    for (int c = 0; c < num_cameras; ++c) {
      for (int i = 0; i < 3; ++i) {
        cameras[c][i] = random.Uniform(-0.4, 0.4);
        cameras[c][3 + i] = random.Uniform(-1.0, 1.0);
      }
      cameras[c][5] -= 6.0;
      cameras[c][6] = random.Uniform(1.0, 1.5);
      cameras[c][7] = random.Uniform(-0.1, 0.1);
      cameras[c][8] = random.Uniform(-0.1, 0.1);
      ceres::AngleAxisToQuaternion(cameras[c].data(), q[c].data());
    }
    for (auto& point : points) {
      for (double& entry : point) entry = random.Uniform(-2.0, 2.0);
    }
  }

  void AddImages(int camera, int point, ceres::Problem* problem) {
    problem->AddResidualBlock(
        new ceres::AutoDiffCostFunction<Reprojection, 2, 9, 3>(
            new Reprojection),
        nullptr,
        cameras[camera].data(),
        points[point].data());
  }

  void AddAllImages(ceres::Problem* problem) {
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      for (std::size_t p = 0; p < points.size(); ++p) {
        AddImages(static_cast<int>(c), static_cast<int>(p), problem);
      }
    }
  }

  // Each camera in two blocks, rotation and translation.
  void AddSplitCameras(ceres::Problem* problem) {
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      problem->AddParameterBlock(q[c].data(), 4, new ceres::QuaternionManifold);
      for (auto& point : points) {
        problem->AddResidualBlock(
            new ceres::AutoDiffCostFunction<QuaternionReprojection, 2, 4, 3, 3>(
                new QuaternionReprojection),
            nullptr,
            q[c].data(),
            cameras[c].data() + 3,
            point.data());
      }
    }
  }

  std::vector<std::array<double, 9>> cameras;
  std::vector<std::array<double, 4>> q;
  std::vector<std::array<double, 3>> points;
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_RANK_PROBLEMS_H_
