// How sure is a trained network? Error bars by Laplace's approximation
// (error_bars.h), beside ensembles of networks and the true errors.
//
// Chain:      two pendulums with a spring between them, and a network that finds
//             the forces on one of them that bring both back to where they were:
//               u = f(a; w),   y = P(u; a),   y* = a
//             The error is y - a at states that were not trained, of the same
//             cube as the data or, "beyond", around it. Where the training data
//             are noisy, y* = a + noise, the error is still y - a.
// Equation:   a front of Burgers' equation, with a known solution:
//               u_t + u u_x = nu u_xx,   u = 1/2 - 1/2 tanh((x - t/2) / (4 nu))
//             u = g + d N, so that initial and boundary values are exact. The
//             error is that of u, on a grid.
//
// Laplace:    with the prior of the initial weights, and with that of the
//             evidence. On the chain without noise the residual of y at a new
//             state is a part of the error: its s^2 is added.
// Ensemble:   the deviation of networks from several seeds, at each point. Each
//             has a noise of its own, or all have the same.
// Coverage:   how many errors are below one and two deviations; 68 % and 95 % of
//             normally distributed ones are.
// Expect:     full coverage for exact data that are many; somewhat too low with
//             noise, few data or the equation; far too low beyond the data.
//
// example_error_bars [NETWORKS]: of each ensemble; 12 if it is left out.
//
// Exits with 0 if, on the chain with the larger noise, the coverage by Laplace
// is 40 to 85 % and 70 to 100 %.

#include "error_bars.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "glog/logging.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/blas_threads.h"
#include "invgrad/equation.h"
#include "invgrad/random.h"
#include "invgrad/time_stepping_simulator.h"
#include "invgrad/train.h"

namespace {

using namespace error_bars;  // NOLINT: the program's other half
using invgrad::DataSet;
using invgrad::InputJet;
using invgrad::Model;

// --- Calibration ---

// Errors and deviations of the networks of an ensemble: a column a network.
struct Calibration {
  MatrixXd errors;
  MatrixXd initial;   // deviations by Prior::kInitial
  MatrixXd evidence;  // by Prior::kEvidence
  // Means over the networks, of the evidence.
  double s = 0.0;
  double determined = 0.0;
  double growth = 0.0;  // of the weights, sqrt(c)

  Calibration(Eigen::Index num_values, int num_networks)
      : errors(num_values, num_networks),
        initial(num_values, num_networks),
        evidence(num_values, num_networks) {}

  // f: values and their errors. has_s: errors have a residual of their own.
  void Add(int k,
           const ErrorBars& by_initial,
           const ErrorBars& by_evidence,
           const Residuals& f,
           bool has_s) {
    const auto deviations = [&](const ErrorBars& bars) {
      const double noise = has_s ? bars.noise_variance() : 0.0;
      const VectorXd variances = bars.Deviations(f.J).cwiseAbs2();
      return VectorXd((variances.array() + noise).sqrt());
    };
    errors.col(k) = f.r;
    initial.col(k) = deviations(by_initial);
    evidence.col(k) = deviations(by_evidence);
    const auto count = static_cast<double>(errors.cols());
    s += std::sqrt(by_evidence.noise_variance()) / count;
    determined += by_evidence.num_determined() / count;
    growth += std::sqrt(by_evidence.prior_scale()) / count;
  }

  // Of each value over the networks, for each of them.
  MatrixXd Spread() const {
    const MatrixXd differences = errors.colwise() - errors.rowwise().mean();
    const VectorXd deviations = (differences.rowwise().squaredNorm() /
                                 static_cast<double>(errors.cols() - 1))
                                    .cwiseSqrt();
    return deviations.replicate(1, errors.cols());
  }

  // The share of errors below `factor` deviations.
  double Coverage(const MatrixXd& deviations, double factor) const {
    return (errors.array().abs() <= factor * deviations.array())
        .cast<double>()
        .mean();
  }
};

double Rms(const MatrixXd& values) {
  return std::sqrt(values.array().square().mean());
}

void PrintHead() {
  std::printf("%-28s  %7s  %7s  %6s  %7s  %-21s  %-21s  %-21s\n",
              "",
              "s",
              "weights",
              "growth",
              "error",
              "prior: initial",
              "prior: evidence",
              "ensemble");
}

void PrintRow(const char* name, const Calibration& of) {
  std::printf("%-28s  %7.1e  %7.0f  %6.1f  %7.1e",
              name,
              of.s,
              of.determined,
              of.growth,
              Rms(of.errors));
  for (const MatrixXd& deviations : {of.initial, of.evidence, of.Spread()}) {
    std::printf("  %7.1e %4.0f %% %3.0f %%",
                Rms(deviations),
                100.0 * of.Coverage(deviations, 1.0),
                100.0 * of.Coverage(deviations, 2.0));
  }
  std::printf("\n");
}

VectorXd Train(const Model& model, const DataSet& samples, int seed) {
  invgrad::TrainOptions options;
  options.max_num_steps = 100;
  options.batch_size = 0;
  options.seed = seed;
  const invgrad::TrainResult result =
      invgrad::Train(model, samples, "geodesic", options);
  CHECK(result.error.empty()) << result.error;
  return result.weights;
}

// --- The chain ---

// Symplectic Euler steps; the force acts on the second pendulum.
struct ChainStep {
  template <typename T>
  bool operator()(const T* state, const T* force, T* next) const {
    using std::sin;
    constexpr double kStep = 0.1;
    constexpr int kNumSubsteps = 4;
    T q0 = state[0], q1 = state[1], v0 = state[2], v1 = state[3];
    for (int i = 0; i < kNumSubsteps; ++i) {
      const T pull = 0.5 * (q1 - q0);
      v0 += kStep * (pull - sin(q0));
      v1 += kStep * (force[0] - pull - sin(q1));
      q0 += kStep * v0;
      q1 += kStep * v1;
    }
    next[0] = q0;
    next[1] = q1;
    next[2] = v0;
    next[3] = v1;
    return true;
  }
};

Model ChainModel() {
  constexpr int kNumSteps = 8;
  return Model(
      invgrad::DenseNetwork({4, 8, 8, kNumSteps}, invgrad::Activation::kTanh),
      std::make_shared<invgrad::TimeSteppingSimulator<ChainStep, 5>>(
          ChainStep(), 4, 1, kNumSteps),
      std::make_shared<invgrad::SquaredNormLoss>(4, 0.5),
      invgrad::Reduction::kMean);
}

// Uniform on [-1, 1]^4.
DataSet States(int num_samples, int seed) {
  const MatrixXd a =
      2.0 * invgrad::NumpyRandom(seed).Rand(4, num_samples).array() - 1.0;
  return {a, a, a, {}};
}

// Of |a_i| from 1/2 to 3/2.
DataSet StatesBeyond(int num_samples, int seed) {
  DataSet states = States(num_samples, seed);
  states.inputs.array() += 0.5 * states.inputs.array().sign();
  states.contexts = states.targets = states.inputs;
  return states;
}

struct ChainSetting {
  int num_samples;
  double noise = 0.0;
  bool has_same_noise = false;
};

// At other states: of the cube and, unless null, beyond.
Calibration CalibrateChain(const ChainSetting& setting,
                           int num_networks,
                           Calibration* beyond = nullptr) {
  const Model model = ChainModel();
  const DataSet test = States(200, 1);
  const DataSet test_beyond = StatesBeyond(200, 2);
  Calibration inside(test.targets.size(), num_networks);
  for (int k = 0; k < num_networks; ++k) {
    DataSet samples = States(setting.num_samples, 0);
    invgrad::NumpyRandom random(100 + (setting.has_same_noise ? 0 : k));
    samples.targets.reshaped() +=
        setting.noise * random.Normal(4 * setting.num_samples);
    const VectorXd weights = Train(model, samples, k + 1);
    const bool has_s = setting.noise == 0.0;
    const ErrorBars initial =
        ErrorBarsOf(model, weights, samples, Prior::kInitial);
    const ErrorBars evidence =
        ErrorBarsOf(model, weights, samples, Prior::kEvidence);
    inside.Add(k, initial, evidence, ResidualsOf(model, weights, test), has_s);
    if (beyond == nullptr) continue;
    beyond->Add(
        k, initial, evidence, ResidualsOf(model, weights, test_beyond), has_s);
  }
  return inside;
}

// Returns the calibration with the larger noise.
Calibration PrintChain(int num_networks) {
  const Calibration none(800, num_networks);
  Calibration exact_beyond = none, noisy_beyond = none;
  const auto calibrate = [&](const ChainSetting& setting) {
    return CalibrateChain(setting, num_networks);
  };
  const Calibration exact = CalibrateChain({600}, num_networks, &exact_beyond);
  Calibration noisy = CalibrateChain({600, 0.2}, num_networks, &noisy_beyond);
  PrintRow("chain, 600 states", exact);
  PrintRow("  beyond the data", exact_beyond);
  PrintRow("  noise 0.05", calibrate({600, 0.05}));
  PrintRow("  noise 0.2", noisy);
  PrintRow("  noise 0.2, the same", calibrate({600, 0.2, true}));
  PrintRow("  noise 0.2, beyond", noisy_beyond);
  PrintRow("chain, 150 states", calibrate({150}));
  PrintRow("  noise 0.05", calibrate({150, 0.05}));
  PrintRow("chain, 40 states", calibrate({40}));
  return noisy;
}

// --- The equation ---

constexpr double kViscosity = 0.05;

struct Burgers {
  template <typename T>
  bool operator()(const T* u, T* y) const {
    y[0] = u[1] + u[0] * u[2] - kViscosity * u[3];  // u, u_t, u_x, u_xx
    return true;
  }
};

template <typename T>
T Front(const T& t, const T& x) {
  using std::tanh;
  return 0.5 - 0.5 * tanh((x - 0.5 * t) / (4.0 * kViscosity));
}

invgrad::Equation BurgersEquation(int num_points) {
  const invgrad::Box box = {Eigen::Vector2d(0.0, -1.0),
                            Eigen::Vector2d(1.0, 1.0)};
  invgrad::Equation burgers;
  invgrad::TrialFunction& trial = burgers.trial;
  trial.derivatives = std::make_shared<invgrad::DerivativeSet>(
      "tx", std::vector<std::string>{"t", "x", "xx"});
  trial.features = invgrad::ScaledFeatures(box);
  trial.boundary_values = [](const InputJet* a, InputJet* g) {
    const InputJet t = a[0], x = a[1], start = 0.0, left = -1.0, right = 1.0;
    g[0] = Front(start, x) +
           0.5 * (1.0 - x) * (Front(t, left) - Front(start, left)) +
           0.5 * (1.0 + x) * (Front(t, right) - Front(start, right));
  };
  trial.distance = [](const InputJet* a, InputJet* d) {
    d[0] = a[0] * (1.0 - a[1] * a[1]);
  };
  burgers.hidden = {12, 12};
  burgers.terms = {
      {"equation",
       std::make_shared<invgrad::AutoDiffSimulator<Burgers, 4, 1>>(),
       invgrad::GaussPoints(box, {num_points, num_points})}};
  return burgers;
}

// u - u* on a grid, as a model's residuals.
invgrad::Equation ValuesOf(const invgrad::Equation& equation) {
  const invgrad::Box box = {Eigen::Vector2d(0.05, -0.95),
                            Eigen::Vector2d(1.0, 0.95)};
  const MatrixXd grid = invgrad::GridPoints(box, {20, 20});
  const VectorXd equal =
      VectorXd::Constant(grid.cols(), 1.0 / static_cast<double>(grid.cols()));
  invgrad::Equation values = equation;
  values.terms = {{"values",
                   std::make_shared<invgrad::ValueResidual>(values.trial),
                   {grid, equal}}};
  values.terms[0].context = [](const VectorXd& a, Eigen::Index, auto c) {
    c[0] = Front(a[0], a[1]);
  };
  return values;
}

DataSet SamplesOf(const invgrad::Equation& equation) {
  DataSet samples;
  std::string error;
  CHECK(EquationSamples(equation, &samples, &error)) << error;
  return samples;
}

Calibration CalibrateEquation(int num_points, int num_networks) {
  const invgrad::Equation burgers = BurgersEquation(num_points);
  const invgrad::Equation values = ValuesOf(burgers);
  const Model model = EquationModel(burgers);
  const Model value_model = EquationModel(values);
  const DataSet samples = SamplesOf(burgers);
  const DataSet grid = SamplesOf(values);
  Calibration result(grid.num_samples(), num_networks);
  for (int k = 0; k < num_networks; ++k) {
    const VectorXd weights = Train(model, samples, k + 1);
    result.Add(k,
               ErrorBarsOf(model, weights, samples, Prior::kInitial),
               ErrorBarsOf(model, weights, samples, Prior::kEvidence),
               ResidualsOf(value_model, weights, grid),
               /*has_s=*/false);
  }
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  google::InitGoogleLogging(argv[0]);
  invgrad::SetBlasThreads(1);
  const int num_networks = argc > 1 ? std::max(std::atoi(argv[1]), 2) : 12;
  PrintHead();
  const Calibration noisy = PrintChain(num_networks);
  PrintRow("Burgers, 20 x 20 points", CalibrateEquation(20, num_networks));
  PrintRow("Burgers, 40 x 40 points", CalibrateEquation(40, num_networks));
  const double covered = noisy.Coverage(noisy.evidence, 1.0);
  const double covered_twice = noisy.Coverage(noisy.evidence, 2.0);
  const bool is_calibrated =
      covered > 0.4 && covered < 0.85 && covered_twice > 0.7;
  std::printf("noise 0.2 %s\n",
              is_calibrated ? "calibrated" : "not calibrated");
  return is_calibrated ? 0 : 1;
}
