// From a simulator alone to scale-invariant physics training: which angles
// bring the tip of a two-link arm to a given place?
//
// use_inverse_simulator.md explains this program piece by piece.
//
// Sample runs:
//
//   use_inverse_simulator
//   use_inverse_simulator --seconds=2
//   use_inverse_simulator --rules=sip,sip:curvature_weight=1

#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gflags/gflags.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/blas_threads.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/method.h"
#include "invgrad/random.h"
#include "invgrad/train.h"

// [rules]
DEFINE_string(rules,
              "adaptive,"
              "dp_adam:step_size=3e-3:schedule=cosine,"
              "newton/numerical/adam:step_size=3e-3:schedule=cosine,"
              "sip:step_size=3e-3:schedule=cosine",
              "what to compare; `compare --list` shows all rules and options");
// [/rules]
DEFINE_double(seconds, 6.0, "training time of each rule");
DEFINE_int32(seed, 1, "of the initial weights");

namespace {

using invgrad::DataSet;
using invgrad::Model;
using invgrad::NumpyRandom;

constexpr double kPi = 3.14159265358979323846;

// [functor]
// Where the tip of an arm of two links is, given the angle of the first and
// that between the two.
struct Arm {
  static constexpr double kUpper = 1.0;  // [m]
  static constexpr double kLower = 0.8;  // [m]
  static constexpr double kRest = 0.5 * kPi;

  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::cos;
    using std::sin;
    y[0] = kUpper * cos(x[0]) + kLower * cos(x[0] + kRest + x[1]);
    y[1] = kUpper * sin(x[0]) + kLower * sin(x[0] + kRest + x[1]);
    return true;
  }
};
// [/functor]

// [inverse]
// angle + 2 pi k closest to `to`.
double Unwrapped(double angle, double to) {
  return angle + 2.0 * kPi * std::round((to - angle) / (2.0 * kPi));
}

// The angles that bring the tip to y, by the law of cosines; none if y is out
// of reach. Of the two arms, elbow up and elbow down, the one that bends as
// x_now does.
std::optional<Eigen::VectorXd> InvertArm(const Eigen::Vector2d& y,
                                         const Eigen::Vector2d& x_now) {
  const double upper = Arm::kUpper;
  const double lower = Arm::kLower;
  const double cosine =
      (y.squaredNorm() - upper * upper - lower * lower) / (2.0 * upper * lower);
  if (std::abs(cosine) > 1.0) return std::nullopt;
  const double elbow =
      std::copysign(std::acos(cosine), std::sin(Arm::kRest + x_now[1]));
  const double shoulder =
      std::atan2(y[1], y[0]) -
      std::atan2(lower * std::sin(elbow), upper + lower * cosine);
  return Eigen::Vector2d(Unwrapped(shoulder, x_now[0]),
                         Unwrapped(elbow - Arm::kRest, x_now[1]));
}
// [/inverse]

// Places in the arm's reach. The network sees the target.
DataSet DrawTargets(int num_samples, NumpyRandom* random) {
  Eigen::MatrixXd targets(2, num_samples);
  for (auto target : targets.colwise()) {
    const double distance = random->Uniform(0.3, 1.7);
    const double direction = random->Uniform(-0.75 * kPi, 0.75 * kPi);
    target[0] = distance * std::cos(direction);
    target[1] = distance * std::sin(direction);
  }
  return invgrad::TrainingData(targets, targets).train;
}

// "-" for methods that invert nothing.
std::string CountText(double count) {
  if (std::isnan(count)) return "-";
  char text[32];
  std::snprintf(text, sizeof(text), "%.7g", count);
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  gflags::SetUsageMessage("trains a network in front of a two-link arm");
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  std::string error;
  std::vector<invgrad::Method> methods;
  if (!invgrad::ParseMethods(FLAGS_rules, &methods, &error)) {
    std::cerr << "--rules: " << error << "\n";
    return 1;
  }
  invgrad::SetBlasThreads(1);

  // [model]
  const Model model(
      invgrad::DenseNetwork({2, 32, 32, 2}, invgrad::Activation::kTanh),
      std::make_shared<invgrad::AutoDiffSimulator<Arm, 2, 2>>(),
      std::make_shared<invgrad::SquaredNormLoss>(2, 0.5),
      invgrad::Reduction::kMean);
  const auto inverse = invgrad::Inverse(InvertArm);
  // [/model]
  NumpyRandom data_random(0);
  const DataSet train = DrawTargets(1024, &data_random);
  const DataSet test = DrawTargets(1024, &data_random);

  std::printf(
      "%-52s  test loss  miss [mm]  ms/step      inverse    numerical  "
      "others\n",
      "rule");
  for (const invgrad::Method& method : methods) {
    std::cerr << "training: " << method.label << "\n";
    // [train]
    invgrad::TrainOptions options;
    options.max_time_in_seconds = FLAGS_seconds;
    options.cpu_time = true;
    options.batch_size = 64;
    options.seed = FLAGS_seed;
    options.inverse = inverse;
    const invgrad::TrainResult result =
        invgrad::Train(model, {train, test}, method, options);
    if (!result.error.empty()) {
      std::cerr << method.label << ": " << result.error << "\n";
      return 1;
    }
    // [/train]

    // [row]
    const invgrad::HistoryRow& last = result.history.back();
    std::printf(
        "%-52s  %9.3g  %9.3g  %7.3g  %11s  %11s  %6s\n",
        method.label.c_str(),
        last.test_loss,
        1e3 * std::sqrt(2.0 * last.test_loss),
        1e3 * result.summary.train_time_in_seconds / result.summary.num_steps,
        CountText(last.by_inverse).c_str(),
        CountText(last.by_numerical_inverse).c_str(),
        CountText(last.by_inverse_gradient + last.by_gradient + last.not_moved)
            .c_str());
    std::cerr << "  " << result.summary.message << "\n";
    // [/row]
  }
  return 0;
}
