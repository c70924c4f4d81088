// A simulator with a sine: many pre-images, and sensitivities that differ by a
// factor xi^2 along axes rotated by phi.
//
//   h = diag(10 / xi, 10 xi) R(phi) x,   y = (sin h_0, h_1)
//   L = 1/2 |y - y*|^2,   y* uniform in [-1, 1]^2
//
// Shapes:  network 2-32-64-32-2, ReLU, 4,354 weights, its input is y*;
//          x, y: 2.
// Units:   none. R(phi) = [cos phi, -sin phi; sin phi, cos phi]; this follows
//          the paper's code; its text has sin(x_0) / xi and no 10.
// Data:    np.random.seed(data_seed); 2 np.random.rand(2 N, 2) - 1, the first N
//          for training. (The code draws new samples for every step.)
// Inverse: of the two families h_0 = asin y_0 + 2 pi k and
//          pi - asin y_0 + 2 pi k the h_0 closest to that of x_0; h_1 = y_1.
//          Local; |y_0| > 1 has no pre-image.
// Facts:   distance to the closest solution, |x - P^-1(y*; x)|, after 600 s
//          on a GPU, read off figures: over xi, xi = 32, phi = 0: SIP 3.9e-4,
//          Adam 4.4e-4; as it is, xi = 32, phi = 45: SIP 1.2e-2, Adam 0.33.
// Source:  Holl, Koltun, Thuerey, NeurIPS 2022, section 4.1, arXiv 2109.15048,
//          and its code, sin_characterization/; PBDL, chapter physgrad-nn.
#ifndef PROBLEMS_SINE_H_
#define PROBLEMS_SINE_H_

#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/sample_data.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/loss.h"

namespace invgrad {

struct SinePhysics {
  double xi = 1.0;
  double phi = 0.0;  // degrees
  double cosine = std::cos(phi * M_PI / 180.0);
  double sine = std::sin(phi * M_PI / 180.0);
  double scale_0 = 10.0 / xi;
  double scale_1 = 10.0 * xi;

  // h(x).
  template <typename T>
  void Scale(const T* x, T* h) const {
    h[0] = scale_0 * (cosine * x[0] - sine * x[1]);
    h[1] = scale_1 * (sine * x[0] + cosine * x[1]);
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
    double h_now[2];
    Scale(x_now.data(), h_now);
    // The angle + 2 pi k closest to that of x_now.
    const auto nearest = [&h_now](double angle) {
      return angle + 2.0 * M_PI * std::round((h_now[0] - angle) / (2.0 * M_PI));
    };
    const double rising = nearest(std::asin(y[0]));
    const double falling = nearest(M_PI - std::asin(y[0]));
    const bool is_rising =
        std::abs(rising - h_now[0]) <= std::abs(falling - h_now[0]);
    const double a = (is_rising ? rising : falling) / scale_0;
    const double b = y[1] / scale_1;
    return Eigen::Vector2d(cosine * a + sine * b, cosine * b - sine * a);
  }

  std::shared_ptr<const InverseSimulator> MakeInverse() const {
    return Inverse([physics = *this](const auto& y, const auto& x_now) {
      return physics.Invert(y, x_now);
    });
  }
};

struct Sine {
  double xi = 1.0;
  double phi = 0.0;
  int num_samples = 10000;
  int data_seed = 0;
  std::string metric = "distance";
  void Describe(OptionSet* set) {
    set->Add("xi", &xi, {0.0, 1e6, true}, "conditioning");
    set->Add("phi", &phi, {-360.0, 360.0}, "rotation, degrees");
    DescribeSamples(1, 1e7, &num_samples, &data_seed, set);
    set->Add("metric",
             &metric,
             {"distance", "relative_distance"},
             "to the closest solution, as it is or over xi");
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    if (!MakeUniformData(
            {num_samples, 2, 4.0}, -1.0, 1.0, data_seed, problem, error)) {
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
    const SinePhysics physics = {xi, phi};
    problem->model = std::make_shared<Model>(
        DenseNetwork({2, 32, 64, 32, 2}, Activation::kRelu),
        std::make_shared<AutoDiffSimulator<SinePhysics, 2, 2>>(physics),
        std::make_shared<SquaredNormLoss>(2, 0.5),
        Reduction::kMean);
    problem->inverse = physics.MakeInverse();
    // The mean distance of x to the closest solution; targets are in range.
    const double scale = metric == "distance" ? 1.0 : 1.0 / xi;
    const auto evaluate = [physics, scale](const Eigen::MatrixXd& x,
                                           const DataSet& data) {
      double sum = 0.0;
      for (int s = 0; s < data.num_samples(); ++s) {
        sum +=
            (x.col(s) - *physics.Invert(data.targets.col(s), x.col(s))).norm();
      }
      return scale * sum / data.num_samples();
    };
    problem->metric = Metric{metric, evaluate};
    return true;
  }
};

// The same physics for one target, without a network: PBDL's picture of the
// landscape.
struct SinePoint {
  double xi = 1.0;
  double phi = 15.0;
  double target_0 = 0.3;
  double target_1 = -0.5;
  double start_0 = 0.22;
  double start_1 = -0.02;
  void Describe(OptionSet* set) {
    set->Add("xi", &xi, {0.0, 1e6, true}, "conditioning");
    set->Add("phi", &phi, {-360.0, 360.0}, "rotation, degrees");
    set->Add("target_0", &target_0, {-1.0, 1.0}, "y*_0");
    set->Add("target_1", &target_1, {}, "y*_1");
    set->Add("start_0", &start_0, {}, "x_0 at the start");
    set->Add("start_1", &start_1, {}, "x_1 at the start");
  }

  bool Create(PointProblem* problem, std::string* /*error*/) const {
    const SinePhysics physics = {xi, phi};
    problem->simulator =
        std::make_shared<AutoDiffSimulator<SinePhysics, 2, 2>>(physics);
    problem->inverse = physics.MakeInverse();
    problem->loss = std::make_shared<SquaredNormLoss>(2, 0.5);
    problem->target = Eigen::Vector2d(target_0, target_1);
    problem->start = Eigen::Vector2d(start_0, start_1);
    problem->minimizer = physics.Invert(problem->target, problem->start);
    problem->minimum = 0.0;
    return true;
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_SINE_H_
