#include "problems/sine.h"

#include <cmath>
#include <optional>

#include "invgrad/chain/autodiff_simulator.h"
#include "invgrad/chain/loss.h"

namespace invgrad {
namespace {

constexpr double kPi = 3.14159265358979323846;

class SinePhysics {
 public:
  SinePhysics(double xi, double phi_in_degrees)
      : cos_(std::cos(phi_in_degrees * kPi / 180.0)),
        sin_(std::sin(phi_in_degrees * kPi / 180.0)),
        scale_0_(10.0 / xi),
        scale_1_(10.0 * xi) {}

  // h(x).
  template <typename T>
  void Scale(const T* x, T* h) const {
    h[0] = scale_0_ * (cos_ * x[0] - sin_ * x[1]);
    h[1] = scale_1_ * (sin_ * x[0] + cos_ * x[1]);
  }

  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::sin;
    Scale(x, y);
    y[0] = sin(y[0]);
    return true;
  }

  // The pre-image of y closest to x_now.
  std::optional<Eigen::VectorXd> Invert(
      const InverseSimulator::ConstVectorRef& y,
      const InverseSimulator::ConstVectorRef& x_now) const {
    if (!(std::abs(y[0]) <= 1.0)) return std::nullopt;
    double h0[2];
    Scale(x_now.data(), h0);
    const double angle = std::asin(y[0]);
    const double rising = NearestOfPeriod(angle, h0[0]);
    const double falling = NearestOfPeriod(kPi - angle, h0[0]);
    const double h = std::abs(rising - h0[0]) <= std::abs(falling - h0[0])
                         ? rising
                         : falling;
    const double a = h / scale_0_;
    const double b = y[1] / scale_1_;
    return Eigen::Vector2d(cos_ * a + sin_ * b, cos_ * b - sin_ * a);
  }

 private:
  // angle + 2 pi k closest to `to`.
  static double NearestOfPeriod(double angle, double to) {
    return angle + 2.0 * kPi * std::round((to - angle) / (2.0 * kPi));
  }

  double cos_;
  double sin_;
  double scale_0_;
  double scale_1_;
};

std::shared_ptr<const InverseSimulator> MakeInverse(
    const SinePhysics& physics) {
  return Inverse([physics](const auto& y, const auto& x_now) {
    return physics.Invert(y, x_now);
  });
}

// The mean distance of x to the closest solution, times `scale`.
Metric MakeMetric(const SinePhysics& physics,
                  const std::string& name,
                  double scale) {
  return {name,
          [physics, scale](const Eigen::MatrixXd& x, const DataSet& data) {
            double sum = 0.0;
            for (int s = 0; s < data.num_samples(); ++s) {
              // Targets are in range.
              sum += (x.col(s) - *physics.Invert(data.targets.col(s), x.col(s)))
                         .norm();
            }
            return scale * sum / data.num_samples();
          }};
}

using SineSimulator = AutoDiffSimulator<SinePhysics, 2, 2>;

}  // namespace

bool Sine::Create(const Options& options,
                  const Eigen::MatrixXd* data,
                  LearningProblem* problem,
                  std::string* error) {
  const auto generate = [&options](int num_rows) {
    return UniformData(-1.0, 1.0, num_rows, 2, options.data_seed);
  };
  if (!MakeData(
          {options.num_samples, 2, 4.0, ""}, data, generate, problem, error)) {
    return false;
  }
  if ((problem->data.col(0).array().abs() > 1.0).any()) {
    *error = "the first column is y*_0; allowed: [-1, 1]";
    return false;
  }
  DataSet all;
  all.inputs = problem->data.transpose();
  all.targets = all.inputs;
  SplitSamples(all, 100, problem);
  const SinePhysics physics(options.xi, options.phi);
  problem->model = std::make_shared<Model>(
      DenseNetwork({2, 32, 64, 32, 2}, Activation::kRelu),
      std::make_shared<SineSimulator>(physics),
      std::make_shared<SquaredNormLoss>(2, 0.5),
      Reduction::kMean);
  problem->inverse = MakeInverse(physics);
  problem->metric =
      MakeMetric(physics,
                 options.metric,
                 options.metric == "distance" ? 1.0 : 1.0 / options.xi);
  return true;
}

bool SinePoint::Create(const Options& options,
                       PointProblem* problem,
                       std::string* /*error*/) {
  const SinePhysics physics(options.xi, options.phi);
  problem->simulator = std::make_shared<SineSimulator>(physics);
  problem->inverse = MakeInverse(physics);
  problem->loss = std::make_shared<SquaredNormLoss>(2, 0.5);
  problem->target = Eigen::Vector2d(options.target_0, options.target_1);
  problem->start = Eigen::Vector2d(options.start_0, options.start_1);
  problem->minimizer = physics.Invert(problem->target, problem->start);
  problem->minimum = 0.0;
  return true;
}

}  // namespace invgrad
