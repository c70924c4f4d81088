// Inverse kinematics: the joint angles of a robot arm with six joints that bring
// its tool to a wanted pose. The closed-form inverse of the arm is a proposal
// inside ceres::Solve.
//
//   pose(q) = Rz(q1) shoulder . Ry(q2) upper arm . Ry(q3) forearm .
//             Rx(q4) Ry(q5) Rx(q6) . tool
//   L = 1/2 |p(q) - p*|^2 / (1 m)^2 + 1/2 |R(q) - R*|^2
//
// The last three axes meet in a point (a spherical wrist), so that the angles
// have a closed form of up to eight solutions [1]; of those within the limits the
// one closest to the current angles is proposed.
//
// Estimated:  q, 6 angles [rad], within the limits of the joints: bounds of the
//             problem.
// Data:       1,000 poses of random angles within the limits.
// Starts:     random angles within the limits, one for each pose.
// Error:      in the second part the real tool is 5 mm longer and tilted by 2
//             degrees, which the closed form does not know. It then leads near
//             the solution, and Ceres does the rest.
// Expect:     plain LM ends at a limit for some of the poses; with the proposal it
//             reaches nearly all.
//
// [1] Pieper. The Kinematics of Manipulators under Computer Control. 1968.
//
// Exits with 0 if the proposals solve at least as many poses, and 90 %.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>

#include "Eigen/Core"
#include "Eigen/Geometry"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "glog/logging.h"
#include "invgrad/proposal.h"
#include "invgrad/random.h"
#include "invgrad/update_callback.h"

namespace {

template <typename T>
using Vector = Eigen::Matrix<T, 3, 1>;
template <typename T>
using Matrix = Eigen::Matrix<T, 3, 3>;
using Angles = Eigen::Matrix<double, 6, 1>;

template <typename T>
Matrix<T> Rotation(const T& angle, int axis) {
  return Eigen::AngleAxis<T>(angle, Vector<T>::Unit(axis)).toRotationMatrix();
}
template <typename T>
Matrix<T> RotX(const T& angle) {
  return Rotation(angle, 0);
}
template <typename T>
Matrix<T> RotY(const T& angle) {
  return Rotation(angle, 1);
}
template <typename T>
Matrix<T> RotZ(const T& angle) {
  return Rotation(angle, 2);
}

template <typename T>
struct Pose {
  Matrix<T> R;
  Vector<T> p;  // [m]
};

// The joints turn by at most so much to each side [rad].
constexpr double kLimits[] = {2.8, 1.7, 2.4, 3.0, 2.0, 3.0};

struct Arm {
  double height = 0.4;     // of the shoulder [m]
  double upper_arm = 0.5;  // [m]
  double forearm = 0.45;   // [m]
  double tool = 0.1;       // from the wrist, along x [m]
  double tilt = 0.0;       // of the tool about y [rad]

  template <typename T>
  Pose<T> Forward(const T* q) const {
    const Matrix<T> shoulder = RotZ(q[0]) * RotY(q[1]);
    const Matrix<T> elbow = shoulder * RotY(q[2]);
    Pose<T> pose;
    pose.R = elbow * RotX(q[3]) * RotY(q[4]) * RotX(q[5]) * RotY(T(tilt));
    pose.p = Vector<T>(T(0.0), T(0.0), T(height)) +
             T(upper_arm) * shoulder.col(0) + T(forearm) * elbow.col(0) +
             T(tool) * pose.R.col(0);
    return pose;
  }

  // The solution within the limits that is closest to `now`; false if there is
  // none.
  bool Invert(const Pose<double>& pose, const double* now, double* q) const {
    const Matrix<double> R = pose.R * RotY(-tilt);
    const Vector<double> wrist =
        pose.p - tool * pose.R.col(0) - Vector<double>(0.0, 0.0, height);
    const double cos_elbow =
        (wrist.squaredNorm() - upper_arm * upper_arm - forearm * forearm) /
        (2.0 * upper_arm * forearm);
    if (!(std::abs(cos_elbow) <= 1.0)) return false;
    double nearest = std::numeric_limits<double>::infinity();
    for (const double front : {1.0, -1.0}) {
      for (const double elbow : {1.0, -1.0}) {
        for (const double flip : {1.0, -1.0}) {
          double s[6];
          s[0] = std::atan2(front * wrist.y(), front * wrist.x());
          const double reach = front * wrist.head<2>().norm();
          s[2] = elbow * std::acos(cos_elbow);
          s[1] = std::atan2(-wrist.z(), reach) -
                 std::atan2(forearm * std::sin(s[2]),
                            upper_arm + forearm * std::cos(s[2]));
          const Matrix<double> W =
              (RotZ(s[0]) * RotY(s[1] + s[2])).transpose() * R;
          s[3] = std::atan2(flip * W(1, 0), -flip * W(2, 0));
          s[4] = flip * std::atan2(std::hypot(W(1, 0), W(2, 0)), W(0, 0));
          s[5] = std::atan2(flip * W(0, 1), flip * W(0, 2));
          double distance = 0.0;
          for (int i = 0; i < 6; ++i) {
            s[i] = std::remainder(s[i], 2.0 * M_PI);
            if (std::abs(s[i]) > kLimits[i]) distance = nearest;
            distance += (s[i] - now[i]) * (s[i] - now[i]);
          }
          if (!(distance < nearest)) continue;
          nearest = distance;
          std::copy_n(s, 6, q);
        }
      }
    }
    return nearest < std::numeric_limits<double>::infinity();
  }
};

struct PoseError {
  template <typename T>
  bool operator()(const T* q, T* residuals) const {
    const Pose<T> pose = arm.Forward(q);
    for (int i = 0; i < 3; ++i) residuals[i] = pose.p[i] - wanted.p[i];
    for (int i = 0; i < 9; ++i) {
      residuals[3 + i] = pose.R(i / 3, i % 3) - wanted.R(i / 3, i % 3);
    }
    return true;
  }
  Arm arm;
  Pose<double> wanted;
};

Angles RandomAngles(invgrad::NumpyGenerator* random) {
  Angles q;
  for (int i = 0; i < 6; ++i) {
    q[i] = kLimits[i] * (2.0 * random->Random() - 1.0);
  }
  return q;
}

constexpr int kNumPoses = 1000;

// Solves all poses, and prints how many and how. Returns the number solved.
int SolveAll(const Arm& real, const Arm& known, bool has_proposals) {
  invgrad::NumpyGenerator random(5);
  int num_solved = 0;
  std::size_t num_iterations = 0;
  double seconds = 0.0;
  for (int k = 0; k < kNumPoses; ++k) {
    const Angles truth = RandomAngles(&random);
    const Pose<double> wanted = real.Forward(truth.data());
    Angles q = RandomAngles(&random);
    ceres::Problem problem;
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PoseError, 12, 6>(
                                 new PoseError{real, wanted}),
                             nullptr,
                             q.data());
    for (int i = 0; i < 6; ++i) {
      problem.SetParameterLowerBound(q.data(), i, -kLimits[i]);
      problem.SetParameterUpperBound(q.data(), i, kLimits[i]);
    }
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.max_num_iterations = 100;
    options.function_tolerance = 1e-12;
    options.logging_type = ceres::SILENT;
    const auto begin = std::chrono::steady_clock::now();
    ceres::Solver::Summary summary;
    if (has_proposals) {
      // [proposal]
      invgrad::UpdateCallback callback(
          [&](const invgrad::ProblemState& x,
              invgrad::ProblemState* candidate) {
            return known.Invert(wanted, x(q.data()), (*candidate)(q.data()));
          },
          &problem);
      callback.AddTo(&options);
      ceres::Solve(options, &problem, &summary);
      // [/proposal]
    } else {
      ceres::Solve(options, &problem, &summary);
    }
    seconds +=
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin)
            .count();
    num_iterations += summary.iterations.size();
    num_solved += summary.final_cost < 1e-10;
  }
  std::printf("  %-16s %4d of %d poses, %5.1f iterations, %.2f ms a pose\n",
              has_proposals ? "LM + inverse" : "LM",
              num_solved,
              kNumPoses,
              static_cast<double>(num_iterations) / kNumPoses,
              1e3 * seconds / kNumPoses);
  return num_solved;
}

}  // namespace

int main(int /*argc*/, char** argv) {
  google::InitGoogleLogging(argv[0]);
  const Arm known;
  Arm real = known;
  real.tool += 0.005;
  real.tilt = 2.0 * M_PI / 180.0;
  bool is_good = true;
  for (const bool is_exact : {true, false}) {
    std::printf(
        "%s\n",
        is_exact ? "exact inverse:" : "inverse without the tool's error:");
    const Arm& arm = is_exact ? known : real;
    const int plain = SolveAll(arm, known, false);
    const int proposed = SolveAll(arm, known, true);
    is_good &= proposed >= plain && proposed >= 0.9 * kNumPoses;
  }
  return is_good ? 0 : 1;
}
