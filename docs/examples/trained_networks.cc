// After training: a network as a part of another problem of Ceres, and an
// ensemble of networks that says how sure it is.
//
//   f(y; theta) = x,   P(x) = y,   trained without x, through P^-1
//
// Surrogate:  x is the velocity of a shuttlecock that is to be at y one second
//             later (shuttlecock_flight.h). A player serves the places t_i.
//             Where to stand?
//
//               minimize 1/2 sum_i |f(t_i - (p, 0))|^2 over p
//
//             The physics' own answer: velocities x_i as further unknowns, and
//             residuals w (P(x_i) - t_i + (p, 0)) with a large weight w.
// Break-even: seconds of training / seconds that the network saves a use,
//             beside the same answers by Ceres and the physics.
// Ensemble:   y = x^2, the problem `multimodal` of compare: 20 networks, each
//             from its own seed and trained by SIP on y in [0, 1].
// Expect:     Places inside of the training data: tanh networks err by a
//             centimetre in p, ReLU networks, which have no curvature, by many.
//             Outside: by metres, and the five networks agree on it.
//             The spread of the ensemble's x is the choice between two
//             pre-images; that of |x| is a third to all of the error, and an
//             eighth at y = 0.
//
// example_trained_networks [FILE]: writes y, sqrt(y), and x of each network of
// the ensemble into FILE, for trained_networks.gp.
//
// Exits with 0 if the tanh networks' answers inside of the training data are
// within kTolerance of the truth, and FILE is written.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "glog/logging.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/blas_threads.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/random.h"
#include "invgrad/train.h"
#include "trained_thrower.h"

namespace {

using namespace trained_networks;  // NOLINT: the program's other half

constexpr int kNumSeeds = 5;
constexpr double kTolerance = 0.05;  // of p [m]

// --- Designs ---

// d2/dp2 of the surrogate's energy: the part of Gauss-Newton, and all.
std::pair<double, double> Curvatures(const TrainedNetwork& thrower,
                                     const Places& places,
                                     double p) {
  constexpr double kShift = 1e-6;
  double gauss_newton = 0.0;
  double rest = 0.0;
  for (const Vector2d& place : places) {
    const SurrogateThrow surrogate(&thrower, place);
    std::array<Vector2d, 3> x, dx_dp;  // at p - kShift, p, p + kShift
    for (int i = 0; i < 3; ++i) {
      const double at = p + (i - 1) * kShift;
      const double* parameters = &at;
      double* jacobian = dx_dp[i].data();
      surrogate.Evaluate(&parameters, x[i].data(), &jacobian);
    }
    gauss_newton += dx_dp[1].squaredNorm();
    rest += x[1].dot(dx_dp[2] - dx_dp[0]) / (2.0 * kShift);
  }
  return {gauss_newton, gauss_newton + rest};
}

// The largest distance by which the surrogate's throws miss.
double LargestMiss(const TrainedNetwork& thrower,
                   const Places& places,
                   double p) {
  double largest = 0.0;
  for (const Vector2d& place : places) {
    const Vector2d wanted = place - Vector2d(p, 0.0);
    const VectorXd x = thrower.network.Outputs(thrower.weights, wanted);
    Vector2d y;
    Flight()(x.data(), y.data());
    largest = std::max(largest, (y - wanted).norm());
  }
  return largest;
}

double Deviation(const VectorXd& values) {
  return std::sqrt((values.array() - values.mean()).square().sum() /
                   static_cast<double>(values.size() - 1));
}

// Prints a row a network; returns the largest error of p.
double PrintDesigns(const Places& places,
                    const std::vector<TrainedNetwork>& throwers) {
  constexpr double kShift = 1e-2;
  const Design truth = SolveByPhysics(places);
  const auto lost = [&](double p) {
    return SolveByPhysics(places, p).energy - truth.energy;
  };
  const double curvature =
      (lost(truth.p + kShift) + lost(truth.p - kShift)) / (kShift * kShift);
  std::printf(
      "           p [m]   error  miss [m]  energy lost  curvature  of it "
      "Gauss-Newton  iterations\n");
  std::printf(
      "physics %8.4f       -         -            -  %9.2f  %18s  %10d\n",
      truth.p,
      curvature,
      "-",
      truth.num_iterations);
  VectorXd p(throwers.size());
  for (size_t i = 0; i < throwers.size(); ++i) {
    const TrainedNetwork& thrower = throwers[i];
    const Design design = SolveBySurrogate(thrower, places);
    const auto [gauss_newton, all] = Curvatures(thrower, places, truth.p);
    p[i] = design.p;
    std::printf("%-7s %8.4f %7.4f  %8.3f %11.4f%%  %9.2f  %18.2f  %10d\n",
                thrower.network.hidden_activation() == Activation::kTanh
                    ? "tanh"
                    : "ReLU",
                design.p,
                design.p - truth.p,
                LargestMiss(thrower, places, design.p),
                100.0 * lost(design.p) / truth.energy,
                all,
                gauss_newton,
                design.num_iterations);
  }
  std::printf("  mean %.4f, deviation %.4f\n", p.mean(), Deviation(p));
  return (p.array() - truth.p).abs().maxCoeff();
}

// --- Break-even ---

// Of this thread's processor, a use; the mean of many.
template <typename Use>
double SecondsOf(const Use& use) {
  constexpr double kAtLeast = 0.2;
  const std::clock_t begin = std::clock();
  double seconds = 0.0;
  int num_uses = 0;
  while (seconds < kAtLeast) {
    use();
    ++num_uses;
    seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  }
  return seconds / num_uses;
}

void PrintBreakEven(const Places& places) {
  constexpr int kNumThrows = 1000;
  const std::clock_t begin = std::clock();
  const TrainedNetwork thrower = TrainThrower(Activation::kTanh, 1);
  const double training =
      static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  const MatrixXd many = places[0].replicate(1, kNumThrows);
  const auto throws = [&thrower](const MatrixXd& y) {
    return SecondsOf(
        [&] { return thrower.network.Outputs(thrower.weights, y); });
  };
  const double one_throw =
      SecondsOf([&] { return SolveByPhysics({places[0]}, 0.0); });
  struct Row {
    const char* use;
    double by_physics, by_network;
  };
  const Row rows[] = {
      {"a throw", one_throw, throws(places[0])},
      {"a throw of 1,000", one_throw, throws(many) / kNumThrows},
      {"a design",
       SecondsOf([&] { return SolveByPhysics(places); }),
       SecondsOf([&] { return SolveBySurrogate(thrower, places); })}};
  std::printf("Break-even after %.2f s of training\n", training);
  std::printf("%-18s  by physics [us]  by the network [us]  uses\n", "");
  for (const Row& row : rows) {
    const double saved = row.by_physics - row.by_network;
    std::printf("%-18s  %15.1f  %19.2f  ",
                row.use,
                1e6 * row.by_physics,
                1e6 * row.by_network);
    if (saved > 0.0) {
      std::printf("%.0f\n", training / saved);
    } else {
      std::printf("never\n");
    }
  }
}

// --- The ensemble ---

struct Square {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = x[0] * x[0];
    return true;
  }
};

// The pre-image on the side of x_now.
std::optional<VectorXd> InvertSquare(const VectorXd& y, const VectorXd& x_now) {
  if (y[0] < 0.0) return std::nullopt;
  return VectorXd::Constant(1, std::copysign(std::sqrt(y[0]), x_now[0]));
}

// As compare --problem=multimodal --rules=sip:step_size=3e-3:schedule=linear
// trains it from this seed in 2,000 steps.
TrainedNetwork TrainRoot(int seed) {
  constexpr int kNumSamples = 2000;
  DenseNetwork network({1, 32, 32, 1}, Activation::kTanh);
  const invgrad::Model model(
      network,
      std::make_shared<invgrad::AutoDiffSimulator<Square, 1, 1>>(),
      std::make_shared<invgrad::SquaredNormLoss>(1, 0.5),
      invgrad::Reduction::kMean);
  const MatrixXd x =
      1.0 - 2.0 * invgrad::NumpyRandom(0).Rand(1, kNumSamples).array();
  invgrad::TrainOptions options;
  options.max_num_steps = 2000;
  options.batch_size = 100;
  options.seed = seed;
  options.inverse = invgrad::Inverse(InvertSquare);
  const invgrad::TrainResult result =
      invgrad::Train(model,
                     {x.cwiseAbs2(), x.cwiseAbs2()},
                     "sip:step_size=3e-3:schedule=linear",
                     options);
  CHECK(result.error.empty()) << result.error;
  return {std::move(network), result.weights};
}

// x of every network, a row each, at the places y (1 x N).
MatrixXd Roots(const std::vector<TrainedNetwork>& networks, const MatrixXd& y) {
  MatrixXd x(networks.size(), y.cols());
  for (size_t i = 0; i < networks.size(); ++i) {
    x.row(i) = networks[i].network.Outputs(networks[i].weights, y);
  }
  return x;
}

// Returns false if the file cannot be written.
bool WriteEnsemble(const std::vector<TrainedNetwork>& networks,
                   const std::string& path) {
  const MatrixXd grid = VectorXd::LinSpaced(151, 0.0, 1.5).transpose();
  const MatrixXd x = Roots(networks, grid);
  std::ofstream file(path);
  for (Eigen::Index j = 0; j < grid.cols(); ++j) {
    file << grid(j) << " " << std::sqrt(grid(j)) << " " << x.col(j).transpose()
         << "\n";
  }
  return !file.flush().fail();
}

void PrintEnsemble(const std::vector<TrainedNetwork>& networks) {
  const MatrixXd x =
      Roots(networks, MatrixXd::Constant(1, 1, 1.0));  // at y = 1
  const auto is_positive = (x.col(0).array() > 0.0).eval();
  std::printf("%ld of %ld networks at x > 0\n",
              static_cast<long>(is_positive.count()),
              static_cast<long>(x.rows()));
  std::printf(
      "    y  sqrt y   x: mean  deviation   |x|: mean  deviation   error of "
      "a network\n");
  for (const double y :
       {0.0, 0.01, 0.1, 0.25, 0.5, 0.75, 1.0, 1.1, 1.25, 1.5}) {
    const VectorXd at = Roots(networks, MatrixXd::Constant(1, 1, y));
    const VectorXd size = at.cwiseAbs();
    std::printf("%5.2f  %6.4f  %8.4f  %9.4f  %10.4f  %9.4f  %18.4f\n",
                y,
                std::sqrt(y),
                at.mean(),
                Deviation(at),
                size.mean(),
                Deviation(size),
                std::sqrt((size.array() - std::sqrt(y)).square().mean()));
  }
}

}  // namespace

int main(int argc, char** argv) {
  google::InitGoogleLogging(argv[0]);
  invgrad::SetBlasThreads(1);
  std::vector<TrainedNetwork> tanh, relu, roots;
  for (int seed = 1; seed <= kNumSeeds; ++seed) {
    tanh.push_back(TrainThrower(Activation::kTanh, seed));
    relu.push_back(TrainThrower(Activation::kRelu, seed));
  }
  const Places inside = {{-4.0, 0.5}, {0.0, 1.0}, {7.0, 0.0}};
  const Places outside = {{-10.0, 0.5}, {0.0, 1.0}, {13.0, 0.0}};
  std::printf("Where to stand, all throws within the training data\n");
  const double error = PrintDesigns(inside, tanh);
  PrintDesigns(inside, relu);
  std::printf("Where to stand, throws beyond the training data\n");
  PrintDesigns(outside, tanh);
  PrintDesigns(outside, relu);

  PrintBreakEven(inside);

  for (int seed = 1; seed <= 20; ++seed) roots.push_back(TrainRoot(seed));
  std::printf("An ensemble on y = x^2\n");
  PrintEnsemble(roots);
  if (argc > 1 && !WriteEnsemble(roots, argv[1])) {
    std::fprintf(stderr, "%s cannot be written\n", argv[1]);
    return 1;
  }
  std::printf("truth %s (tolerance %g m)\n",
              error < kTolerance ? "found" : "missed",
              kTolerance);
  return error < kTolerance ? 0 : 1;
}
