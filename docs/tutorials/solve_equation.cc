// Solves a differential equation of one's own by a physics-informed network: no
// tables, only the library.
//
// Sample run:
//
//   build/release/bin/solve_equation
//
// It writes solve_equation.txt.
// docs/tutorials/solve_equation.md explains each part.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gflags/gflags.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/blas_threads.h"
#include "invgrad/equation.h"
#include "invgrad/train.h"

DEFINE_int32(steps, 300, "training steps");

namespace {

// [equation]
// Fisher's equation, u_t = D u_xx + u (1 - u): a population spreads.
constexpr double kDiffusivity = 0.01;
struct Fisher {
  template <typename T>
  bool operator()(const T* u, T* y) const {
    y[0] = u[1] - kDiffusivity * u[2] - u[0] * (1.0 - u[0]);  // u, u_t, u_xx
    return true;
  }
};
// [/equation]

// [wave]
// A wave that solves it. T: a number, or a jet with derivatives.
template <typename T>
T Wave(const T& t, const T& x) {
  const double slope = 1.0 / std::sqrt(6.0 * kDiffusivity);
  const double speed = 5.0 * std::sqrt(kDiffusivity / 6.0);
  return pow(1.0 + exp(slope * (x - speed * t)), -2.0);
}
// [/wave]

}  // namespace

int main(int argc, char** argv) {
  invgrad::SetBlasThreads(1);
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  using namespace invgrad;  // NOLINT
  // [trial]
  Equation fisher;
  fisher.trial.derivatives = std::make_shared<DerivativeSet>(
      "tx", std::vector<std::string>{"t", "xx"});
  fisher.trial.boundary_values = [](const InputJet* a, InputJet* g) {
    g[0] = Wave(InputJet(0.0), a[1]);  // u(0, x)
  };
  fisher.trial.distance = [](const InputJet* a, InputJet* d) { d[0] = a[0]; };
  fisher.hidden = {20, 20};
  // [/trial]
  // [terms]
  const Box box = {Eigen::Vector2d(0.0, -1.0), Eigen::Vector2d(2.0, 1.0)};
  EquationTerm ends = {"ends",
                       std::make_shared<ValueResidual>(fisher.trial),
                       FacePoints(box, /*first=*/1, /*count=*/40),
                       /*weight=*/10.0};
  ends.context = [](const Eigen::VectorXd& a, Eigen::Index, auto c) {
    c[0] = Wave(a[0], a[1]);  // u(t, -1) and u(t, 1)
  };
  fisher.terms = {{"equation",
                   std::make_shared<AutoDiffSimulator<Fisher, 3, 1>>(),
                   GaussPoints(box, {24, 32})},
                  ends};
  // [/terms]
  // [train]
  DataSet samples;
  std::string error;
  if (!EquationSamples(fisher, &samples, &error)) {
    std::fprintf(stderr, "%s\n", error.c_str());
    return 1;
  }
  TrainOptions options;
  options.batch_size = 0;  // all points
  options.max_num_steps = FLAGS_steps;
  const TrainResult result =
      Train(EquationModel(fisher), samples, "geodesic", options);
  if (!result.error.empty()) {
    std::fprintf(stderr, "%s\n", result.error.c_str());
    return 1;
  }
  // [/train]
  // [solution]
  const Eigen::MatrixXd points = GridPoints(box, {41, 101});
  Eigen::MatrixXd u;
  if (!Solution(fisher, result.weights, points, &u, &error)) {
    std::fprintf(stderr, "%s\n", error.c_str());
    return 1;
  }
  std::ofstream file("solve_equation.txt");
  double largest = 0.0;
  for (Eigen::Index s = 0; s < points.cols(); ++s) {
    const double difference = std::abs(u(s) - Wave(points(0, s), points(1, s)));
    largest = std::max(largest, difference);
    file << (s % 101 == 0 ? "\n" : "") << points.col(s).transpose() << ' '
         << u(s) << ' ' << difference << '\n';
  }
  // [/solution]
  std::printf("%s: loss %.1e after %ld steps; largest error %.1e\n",
              result.summary.message.c_str(),
              result.history.back().train_loss,
              result.summary.num_steps,
              largest);
  return 0;
}
