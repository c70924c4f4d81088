// What the methods do on problems with known answers: the measurements that
// physical_gradients.cc prints and tests/docs/physical_gradients_test.cc
// compares with closed forms.
//
// Source:  PBDL, chapters physgrad, physgrad-nn and physgrad-hig, arXiv
//          2109.05237.
#ifndef PHYSICAL_GRADIENTS_H_
#define PHYSICAL_GRADIENTS_H_

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "glog/logging.h"
#include "invgrad/autodiff_loss.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/loss.h"
#include "invgrad/method.h"
#include "invgrad/minimize.h"
#include "invgrad/random.h"
#include "invgrad/train.h"

namespace physical_gradients {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

// --- Steps of a method, without a network ---

enum MethodIndex {
  kGradientDescent,
  kNewton,
  kHalfInverse,
  kInverseGradient,
  kPhysicalGradient,
  kNumMethods,
};

struct NamedMethod {
  const char* name;
  const char* text;  // what precedes the step size
};

// Newton's method without a fallback: no step where the Hessian is zero.
constexpr NamedMethod kMethods[kNumMethods] = {
    {"gradient descent", "gradient_descent:step_size="},
    {"Newton", "newton:fallback_step_size=1e-300:step_size="},
    {"half-inverse", "half_inverse:step_size="},
    {"inverse gradient",
     "gradient/inverse_gradient/gradient_descent:step_size=1:y_step_size="},
    {"physical gradient",
     "gradient/inverse/gradient_descent:step_size=1:y_step_size="}};

inline std::string WithNumber(const std::string& text, double number) {
  std::ostringstream stream;
  stream << text << number;
  return stream.str();
}

inline std::string MethodText(int method, double step_size) {
  return WithNumber(kMethods[method].text, step_size);
}

// A simulator, a loss of its output, and a target.
struct PointSetting {
  std::shared_ptr<const invgrad::Simulator> simulator;
  std::shared_ptr<const invgrad::InverseSimulator> inverse;
  VectorXd target;
  std::shared_ptr<const invgrad::Loss> loss =
      std::make_shared<invgrad::SquaredNormLoss>(
          static_cast<int>(target.size()), 0.5);
};

// The points from the start on; fewer if the method ends or fails.
inline std::vector<VectorXd> Path(const PointSetting& setting,
                                  const VectorXd& start,
                                  const std::string& text,
                                  int num_steps) {
  invgrad::Method method;
  std::string error;
  CHECK(invgrad::ParseMethod(text, &method, &error)) << error;
  invgrad::PointObjective objective(
      setting.simulator, setting.loss, setting.target, start);
  invgrad::MinimizerOptions options;
  options.max_num_iterations = num_steps;
  options.gradient_tolerance = 0.0;
  options.function_tolerance = 0.0;
  options.parameter_tolerance = 0.0;
  std::vector<VectorXd> path;
  invgrad::MinimizerSummary summary;
  CHECK(invgrad::MinimizeByMethod(
      method, options, setting.inverse, &objective, &path, &summary, &error))
      << error;
  return path;
}

// NaN if there is no step.
inline double ScalarStep(const PointSetting& setting,
                         double x,
                         const std::string& text) {
  const auto path = Path(setting, VectorXd::Constant(1, x), text, 1);
  return path.size() == 2 ? path[1][0] - x
                          : std::numeric_limits<double>::quiet_NaN();
}

// y = function(x), x = inverse(y, x_now), all scalars.
template <typename Function, typename InverseFunction>
PointSetting ScalarSetting(Function function,
                           InverseFunction inverse,
                           double target) {
  return {
      std::make_shared<invgrad::AutoDiffSimulator<Function, 1, 1>>(function),
      invgrad::Inverse([inverse](const auto& y, const auto& x_now) {
        return std::optional<VectorXd>(
            VectorXd::Constant(1, inverse(y[0], x_now[0])));
      }),
      VectorXd::Constant(1, target)};
}

// --- 1. y = c x: the change of the loss ---

struct Scaled {
  double c;
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = c * x[0];
    return true;
  }
};

struct OutputLoss {  // L = y
  template <typename T>
  bool operator()(const T* y, const double* /*target*/, T* loss) const {
    *loss = y[0];
    return true;
  }
};

// The fall of L = y, or of L = 1/2 (y - 1)^2 from y = 0, in a step with a small
// eta, over eta.
inline double FallOfLoss(const std::string& method, double c, bool is_linear) {
  constexpr double kEta = 1e-6;
  PointSetting setting = ScalarSetting(
      Scaled{c}, [c](double y, double /*x_now*/) { return y / c; }, 1.0);
  if (is_linear) {
    setting.loss = std::make_shared<invgrad::AutoDiffLoss<OutputLoss, 1>>();
  }
  const double y = c * ScalarStep(setting, 0.0, WithNumber(method, kEta));
  return (is_linear ? -y : y - 0.5 * y * y) / kEta;
}

// --- 2. L = 1/2 (z(y(x)) - z*)^2, z = sqrt(y): the change of y ---

enum InnerFunction { kSame, kTenfold, kExponential, kCube, kNumInner };

template <typename T>
T Inner(int function, const T& x) {
  using std::exp;
  switch (function) {
    case kTenfold:
      return 10.0 * x;
    case kExponential:
      return exp(x);
    case kCube:
      return x * x * x;
    default:
      return x;
  }
}

inline double InvertInner(int function, double y) {
  switch (function) {
    case kTenfold:
      return y / 10.0;
    case kExponential:
      return std::log(y);
    case kCube:
      return std::cbrt(y);
    default:
      return y;
  }
}

struct RootOfInner {
  int function;
  template <typename T>
  bool operator()(const T* x, T* z) const {
    using std::sqrt;
    z[0] = sqrt(Inner(function, x[0]));
    return true;
  }
};

// In a step from y = 1, with z* = 3.
inline double ChangeOfY(int method, int function, double eta) {
  const PointSetting setting = ScalarSetting(
      RootOfInner{function},
      [function](double z, double /*x_now*/) {
        return InvertInner(function, z * z);
      },
      3.0);
  const double x = InvertInner(function, 1.0);
  return Inner(function, x + ScalarStep(setting, x, MethodText(method, eta))) -
         1.0;
}

// --- 5. y = x + epsilon sin(k x): high-frequency noise ---

struct Noisy {
  static constexpr double kEpsilon = 0.01;
  double k;
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::sin;
    y[0] = x[0] + kEpsilon * sin(k * x[0]);
    return true;
  }

  // The pre-image closest to x_now, which is farther than epsilon from y: the
  // first sign change on the way from there through [y - epsilon, y + epsilon].
  double Invert(double y, double x_now) const {
    const double direction = x_now > y ? -1.0 : 1.0;
    const auto has_passed = [&](double x) {
      return direction * (x + kEpsilon * std::sin(k * x) - y) >= 0.0;
    };
    double step = direction * 0.1 / k;
    double x = y - direction * kEpsilon;
    while (!has_passed(x + step)) x += step;
    for (int i = 0; i < 60; ++i) {
      step *= 0.5;
      if (!has_passed(x + step)) x += step;
    }
    return x;
  }
};

struct StepErrors {
  double median;
  double largest;
};

// |step + x|, the distance from 0, to which the step without noise leads, over
// starts x in [0.5, 1.5]; y* = 0.
inline StepErrors NoiseErrors(const std::string& method, double k) {
  constexpr int kNumStarts = 201;
  const Noisy noisy{k};
  const PointSetting setting = ScalarSetting(
      noisy,
      [noisy](double y, double x_now) { return noisy.Invert(y, x_now); },
      0.0);
  std::vector<double> errors;
  for (int i = 0; i < kNumStarts; ++i) {
    const double x = 0.5 + static_cast<double>(i) / (kNumStarts - 1);
    const double error = std::abs(x + ScalarStep(setting, x, method));
    errors.push_back(std::isnan(error) ? HUGE_VAL : error);
  }
  std::sort(errors.begin(), errors.end());
  return {errors[kNumStarts / 2], errors.back()};
}

// --- 6. and 7. y = exp(x) and y = x^2 ---

struct Exp {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::exp;
    y[0] = exp(x[0]);
    return true;
  }
};

struct Square {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = x[0] * x[0];
    return true;
  }
};

inline PointSetting ExpSetting(double target) {
  return ScalarSetting(
      Exp{}, [](double y, double /*x_now*/) { return std::log(y); }, target);
}

inline PointSetting SquareSetting() {
  return ScalarSetting(
      Square{},
      [](double y, double x_now) { return std::copysign(std::sqrt(y), x_now); },
      0.0);
}

// |x_k - x*|, k = 0 .. num_steps; the last one stays where a method ends.
inline std::vector<double> Distances(const PointSetting& setting,
                                     double start,
                                     double optimum,
                                     const std::string& method,
                                     int num_steps) {
  std::vector<double> distances;
  for (const VectorXd& x :
       Path(setting, VectorXd::Constant(1, start), method, num_steps)) {
    distances.push_back(std::abs(x[0] - optimum));
  }
  distances.resize(num_steps + 1, distances.back());
  return distances;
}

// |P^-1(y; x_0) - P^-1(y)| for y = exp(x_0) + change, exp(x_0) = 2, where the
// local inverse is a few steps of a method towards y.
inline double LocalInverseError(const std::string& method,
                                int num_steps,
                                double change) {
  return Distances(ExpSetting(2.0 + change),
                   std::log(2.0),
                   std::log(2.0 + change),
                   method,
                   num_steps)
      .back();
}

// --- 10. Two samples in a batch, close to each other ---

struct TwoSampleStep {
  double length;  // of the step of 30 weights
  double loss;    // of the batch, after the step
};

// The toy network of the book, inputs 0.3 and 0.3 + distance; `conflict` is
// added to the second target. Medians over nine initial networks.
inline TwoSampleStep StepOfTwoSamples(const std::string& rule,
                                      double distance,
                                      double conflict) {
  constexpr int kNumNetworks = 9;
  const invgrad::DenseNetwork network({1, 7, 2}, invgrad::Activation::kTanh);
  const invgrad::Model model(network,
                             std::make_shared<invgrad::IdentitySimulator>(2),
                             std::make_shared<invgrad::SquaredNormLoss>(2, 0.5),
                             invgrad::Reduction::kSum);
  MatrixXd a(1, 2);
  a << 0.3, 0.3 + distance;
  MatrixXd targets(2, 2);
  targets.row(0) = (6.0 * a.array()).sin();
  targets.row(1) = (9.0 * a.array()).cos();
  targets.col(1).array() += conflict;
  std::vector<double> lengths, losses;
  for (int seed = 1; seed <= kNumNetworks; ++seed) {
    invgrad::NumpyRandom random(seed);
    invgrad::TrainOptions options;
    options.batch_size = 0;
    options.max_num_steps = 1;
    options.initial_weights = network.InitialWeights(
        invgrad::Initialization::kGlorotUniform, &random);
    const VectorXd initial = options.initial_weights;
    const invgrad::TrainResult result =
        invgrad::Train(model, {a, targets}, rule, options);
    CHECK(result.error.empty()) << result.error;
    lengths.push_back((result.weights - initial).norm());
    losses.push_back(result.history.back().train_loss);
  }
  std::sort(lengths.begin(), lengths.end());
  std::sort(losses.begin(), losses.end());
  return {lengths[kNumNetworks / 2], losses[kNumNetworks / 2]};
}

}  // namespace physical_gradients

#endif  // PHYSICAL_GRADIENTS_H_
