// Camera bundle adjustment: a ring of cameras that looks at a cloud of points.
//
//   pixel_ij = f (p_x, p_y) / p_z + noise,   p = R_i X_j + t_i
//   L = 1/2 sum_ij rho(|pixel(R_i, t_i, X_j) - pixel_ij|^2 / noise^2)
//
// Estimated:  rotations R_i (unit quaternions), translations t_i and points X_j.
//             The focal length f = 500 pixels is known.
// Truth:      10 cameras on a circle of radius 6 about 60 points, which are
//             normally distributed with a standard deviation of 1; the world's
//             frame is that of camera 0. Every camera sees every point.
// Data:       normal noise of 0.5 pixels; 3 in 100 matches are wrong: a
//             uniformly distributed pixel of the image.
// Start:      rotations are off by about 6 degrees, translations and points by
//             about 0.3 in each direction.
// Loss:       Huber, of scale 2: residuals above a pixel count linearly.
// Gauge:      camera 0 is constant, and |t_1| is, by a SphereManifold. Nothing
//             else fixes where the world is and how large.
// Expect:     points within a hundredth of the truth, by any solver, and no gain
//             from proposals: where Gauss-Newton's linear model holds, nothing
//             is faster.
//
// Solved by Ceres' Levenberg-Marquardt, by the same with geodesic steps proposed,
// and by the same with a closed form as the proposal: the cameras stay, and each
// point is triangulated from them. Exits with 0 if all find the points within
// kTolerance of the truth (root of the mean square of |X_j - truth|).

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/Geometry"
#include "ceres/autodiff_cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "ceres/sphere_manifold.h"
#include "glog/logging.h"
#include "invgrad/proposal.h"
#include "invgrad/random.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"

namespace {

using Eigen::Quaterniond;
using Eigen::Vector2d;
using Eigen::Vector3d;
using invgrad::NumpyGenerator;

constexpr int kNumCameras = 10;
constexpr int kNumPoints = 60;
constexpr double kRadius = 6.0;
constexpr double kFocalLength = 500.0;  // [pixels]
constexpr double kNoise = 0.5;          // [pixels]
// Half a pixel is 0.006 at the distance of the points; errors of the cameras,
// which all points share, are of the same size.
constexpr double kTolerance = 0.02;

struct Camera {
  Quaterniond rotation;
  Vector3d translation;
};

struct Scene {
  std::vector<Camera> cameras;
  std::vector<Vector3d> points;
};

struct ReprojectionError {
  Vector2d pixel;

  template <typename T>
  bool operator()(const T* rotation,
                  const T* translation,
                  const T* point,
                  T* residuals) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q(rotation);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t(translation), x(point);
    const Eigen::Matrix<T, 3, 1> p = q * x + t;
    if (p[2] < 1e-3) return false;  // behind the camera
    for (int i = 0; i < 2; ++i) {
      residuals[i] = (kFocalLength * p[i] / p[2] - pixel[i]) / kNoise;
    }
    return true;
  }
};

// Cameras at angles around the y axis, each looking at the middle.
Scene TrueScene(NumpyGenerator* random) {
  Scene scene;
  const Vector3d middle(0.0, 0.0, kRadius);  // in camera 0's frame
  for (int i = 0; i < kNumCameras; ++i) {
    const Quaterniond q(
        Eigen::AngleAxisd(2.0 * EIGEN_PI * i / kNumCameras, Vector3d::UnitY()));
    scene.cameras.push_back({q, middle - q * middle});
  }
  for (int j = 0; j < kNumPoints; ++j) {
    scene.points.push_back(middle + random->StandardNormal(3, 1));
  }
  return scene;
}

// The truth, moved at random; but camera 0 and |t_1| are as they were.
Scene Perturbed(const Scene& truth, NumpyGenerator* random) {
  Scene scene = truth;
  for (int i = 1; i < kNumCameras; ++i) {
    Camera* camera = &scene.cameras[i];
    const Vector3d angles = 0.06 * random->StandardNormal(3, 1);
    camera->rotation = Eigen::AngleAxisd(angles.norm(), angles.normalized()) *
                       camera->rotation;
    const double distance = camera->translation.norm();
    camera->translation += 0.3 * random->StandardNormal(3, 1);
    if (i == 1) camera->translation *= distance / camera->translation.norm();
  }
  for (Vector3d& point : scene.points) {
    point += 0.3 * random->StandardNormal(3, 1);
  }
  return scene;
}

// pixels[i * kNumPoints + j]: point j in camera i.
std::vector<Vector2d> Photograph(const Scene& scene, NumpyGenerator* random) {
  std::vector<Vector2d> pixels;
  for (const Camera& camera : scene.cameras) {
    for (const Vector3d& point : scene.points) {
      Vector2d pixel;
      CHECK(ReprojectionError{Vector2d::Zero()}(camera.rotation.coeffs().data(),
                                                camera.translation.data(),
                                                point.data(),
                                                pixel.data()));
      pixel = kNoise * (pixel + random->StandardNormal(2, 1));
      if (random->Random() < 0.03) {
        for (double& x : pixel) x = 640.0 * (random->Random() - 0.5);
      }
      pixels.push_back(pixel);
    }
  }
  return pixels;
}

double PointError(const Scene& scene, const Scene& truth) {
  double sum = 0.0;
  for (int j = 0; j < kNumPoints; ++j) {
    sum += (scene.points[j] - truth.points[j]).squaredNorm();
  }
  return std::sqrt(sum / kNumPoints);
}

// [triangulate]
// The point closest to its lines of sight, sum_i w_i |(I - d_i d_i^T) (X - c_i)|^2
// with centers c_i and directions d_i. A line that misses the present point by e
// pixels has the weight of Huber's loss, 1 / max(1, e), over its squared length.
bool Triangulate(const std::vector<Camera>& cameras,
                 const Vector2d* pixels,  // of camera i: pixels[i * kNumPoints]
                 Eigen::Map<Vector3d> point) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Vector3d b = Vector3d::Zero();
  for (const Camera& camera : cameras) {
    const Vector3d center = -(camera.rotation.conjugate() * camera.translation);
    const Vector3d sight = (camera.rotation.conjugate() *
                            Vector3d(pixels->x(), pixels->y(), kFocalLength))
                               .normalized();
    const Eigen::Matrix3d across =
        Eigen::Matrix3d::Identity() - sight * sight.transpose();
    const double depth = sight.dot(point - center);
    const double miss =
        kFocalLength * (across * (point - center)).norm() / depth;
    const double weight = 1.0 / (std::max(1.0, miss) * depth * depth);
    A += weight * across;
    b += weight * across * center;
    pixels += kNumPoints;
  }
  point = A.ldlt().solve(b);
  return point.allFinite();
}
// [/triangulate]

struct Solver {
  std::string label;
  std::string rule;           // that proposes; empty: none
  bool triangulates = false;  // proposes triangulated points
};

struct Outcome {
  double error_at_start = 0.0;  // of the points
  double error = 0.0;
  ceres::Solver::Summary solver;
  std::string proposals;

  bool IsTruth() const { return error < kTolerance; }
};

Outcome Adjust(const std::vector<Vector2d>& pixels,
               const Scene& truth,
               Scene scene,
               const Solver& solver) {
  // Build.
  ceres::Problem problem;
  for (int i = 0; i < kNumCameras; ++i) {
    Camera* camera = &scene.cameras[i];
    for (int j = 0; j < kNumPoints; ++j) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<ReprojectionError, 2, 4, 3, 3>(
              new ReprojectionError{pixels[i * kNumPoints + j]}),
          new ceres::HuberLoss(2.0),
          camera->rotation.coeffs().data(),
          camera->translation.data(),
          scene.points[j].data());
    }
    problem.SetManifold(camera->rotation.coeffs().data(),
                        new ceres::EigenQuaternionManifold);
  }
  problem.SetParameterBlockConstant(scene.cameras[0].rotation.coeffs().data());
  problem.SetParameterBlockConstant(scene.cameras[0].translation.data());
  problem.SetManifold(scene.cameras[1].translation.data(),
                      new ceres::SphereManifold<3>);

  // Configure.
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.max_num_iterations = 100;
  options.logging_type = ceres::SILENT;

  std::unique_ptr<invgrad::UpdateRule> rule;
  std::optional<invgrad::UpdateCallback> callback;
  if (!solver.rule.empty()) {
    rule = invgrad::MakeRule(solver.rule);
    callback.emplace(rule.get(), &problem);
  } else if (solver.triangulates) {
    // [proposal]
    callback.emplace(
        [&](const invgrad::ProblemState& x, invgrad::ProblemState* candidate) {
          std::vector<Camera> cameras;
          for (const Camera& camera : scene.cameras) {
            cameras.push_back({Quaterniond(x(camera.rotation.coeffs().data())),
                               Vector3d(x(camera.translation.data()))});
          }
          for (int j = 0; j < kNumPoints; ++j) {
            if (!Triangulate(cameras,
                             &pixels[j],
                             Eigen::Map<Vector3d>(
                                 (*candidate)(scene.points[j].data())))) {
              return false;
            }
          }
          return true;
        },
        &problem);
    // [/proposal]
  }
  if (callback) callback->AddTo(&options);

  // Solve.
  Outcome outcome;
  outcome.error_at_start = PointError(scene, truth);
  ceres::Solve(options, &problem, &outcome.solver);
  outcome.error = PointError(scene, truth);
  if (callback) outcome.proposals = callback->summary().BriefReport();
  return outcome;
}

void ReportOne(const Solver& solver, const Outcome& outcome) {
  std::printf(
      "%s: %zu iterations, cost %.4g -> %.4g, error of points %.3g -> %.3g\n",
      solver.label.c_str(),
      outcome.solver.iterations.size() - 1,
      outcome.solver.initial_cost,
      outcome.solver.final_cost,
      outcome.error_at_start,
      outcome.error);
  if (!outcome.proposals.empty()) {
    std::printf("  %s\n", outcome.proposals.c_str());
  }
}

}  // namespace

int main(int /*argc*/, char** argv) {
  google::InitGoogleLogging(argv[0]);
  const std::vector<Solver> solvers = {{"LM", "", false},
                                       {"LM + geodesic", "geodesic", false},
                                       {"LM + triangulation", "", true}};
  NumpyGenerator random(2);
  const Scene truth = TrueScene(&random);
  const std::vector<Vector2d> pixels = Photograph(truth, &random);
  const Scene start = Perturbed(truth, &random);
  bool is_found = true;
  for (const Solver& solver : solvers) {
    const Outcome outcome = Adjust(pixels, truth, start, solver);
    ReportOne(solver, outcome);
    is_found &= outcome.IsTruth();
  }
  std::printf(
      "truth %s (tolerance %g)\n", is_found ? "found" : "missed", kTolerance);
  return is_found ? 0 : 1;
}
