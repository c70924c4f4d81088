#include "problems/oscillator_tracking.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>

#include "Eigen/QR"
#include "glog/logging.h"
#include "invgrad/chain/trajectory_simulator.h"
#include "invgrad/io/numpy_random.h"
#include "problems/sample_data.h"

namespace invgrad {

namespace {

// Chain and reference.
template <int kNumOscillators>
struct TrackingStep {
  OscillatorStep<kNumOscillators> chain;
  double cosine[2] = {};  // of omega_i dt
  double sine[2] = {};

  template <typename T>
  bool operator()(const T* state, const T* u, T* next_state) const {
    const int chain_size =
        2 * (kNumOscillators > 0 ? kNumOscillators : chain.num_oscillators);
    for (int i = 0; i < 2; ++i) {
      const T& a = state[chain_size + 2 * i];
      const T& b = state[chain_size + 2 * i + 1];
      next_state[chain_size + 2 * i] = cosine[i] * a + sine[i] * b;
      next_state[chain_size + 2 * i + 1] = cosine[i] * b - sine[i] * a;
    }
    return chain(state, u, next_state);
  }
};

// The terms of the loss.
struct TrackingTerms {
  int num_oscillators = 2;
  int horizon = 1;
  double error_factor = 1.0;
  double end_factor = 1.0;
  double force_factor = 1.0;

  template <typename T>
  bool operator()(int t, const T* next_state, const T* u, T* terms) const {
    const T& position = next_state[num_oscillators - 1];
    const T* reference = next_state + 2 * num_oscillators;
    terms[0] = (t + 1 == horizon ? end_factor : error_factor) *
               (position - (reference[0] + reference[2]));
    terms[1] = force_factor * u[0];
    return true;
  }
};

template <int kNumOscillators, int kStride>
void SetModel(const OscillatorTracking::Options& options,
              LearningProblem* problem) {
  const int state_size = 2 * options.num_oscillators + 4;
  TrackingStep<kNumOscillators> step;
  step.chain.num_oscillators = options.num_oscillators;
  step.chain.dt = options.dt;
  if (options.coupling == "cubic") {
    step.chain.linear = 0.0;
    step.chain.cubic = 1.0;
    step.chain.control = 3.0;
  }
  for (int i = 0; i < 2; ++i) {
    const double angle = OscillatorTracking::kFrequencies[i] * options.dt;
    step.cosine[i] = std::cos(angle);
    step.sine[i] = std::sin(angle);
  }
  TrackingTerms terms;
  terms.num_oscillators = options.num_oscillators;
  terms.horizon = options.horizon;
  terms.error_factor = std::sqrt(options.dt);
  terms.end_factor = std::sqrt(options.dt * options.end_weight);
  terms.force_factor = std::sqrt(options.dt * options.control_weight);
  const auto simulator =
      std::make_shared<TrajectorySimulator<TrackingStep<kNumOscillators>,
                                           TrackingTerms,
                                           kStride>>(
          step, terms, state_size, 1, 2, options.horizon);
  problem->model = std::make_shared<Model>(
      DenseNetwork({state_size, 16, 16, 1}, Activation::kTanh),
      simulator,
      std::make_shared<SquaredNormLoss>(simulator->num_outputs(), 1.0),
      Reduction::kMean,
      simulator);
}

// With linear coupling y = y_0(s_0) + J x with the same J for all samples. What
// is left of y at the best x is perpendicular to the columns of J, so that the
// rest, |Q^T y|^2 with J = Q R, is what a better x could still gain.
Metric Regret(const std::shared_ptr<const Model>& model) {
  const Simulator& simulator = model->simulator();
  const int num_y = simulator.num_outputs();
  const int num_x = simulator.num_inputs();
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(simulator.num_context());
  const Eigen::VectorXd no_force = Eigen::VectorXd::Zero(num_x);
  Eigen::VectorXd y(num_y);
  Eigen::MatrixXd J_transposed(num_x, num_y);
  CHECK(simulator.Evaluate(
      no_force.data(), rest.data(), y.data(), J_transposed.data()));
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(
      J_transposed.transpose());
  const Eigen::MatrixXd Q =
      qr.householderQ() * Eigen::MatrixXd::Identity(num_y, qr.rank());
  const auto evaluate = [model, Q](const Eigen::MatrixXd& x,
                                   const DataSet& data) {
    CHECK_EQ(x.cols(), data.num_samples());
    CHECK_EQ(x.rows(), Q.rows() / 2);
    Eigen::VectorXd y(Q.rows());
    double sum = 0.0;
    for (int s = 0; s < data.num_samples(); ++s) {
      if (!model->simulator().Evaluate(x.col(s).data(),
                                       data.contexts.col(s).data(),
                                       y.data(),
                                       nullptr)) {
        return std::numeric_limits<double>::quiet_NaN();
      }
      sum += (Q.transpose() * y).squaredNorm();
    }
    return sum / data.num_samples();
  };
  return {"regret", evaluate};
}

}  // namespace

bool OscillatorTracking::Create(const Options& options,
                                const Eigen::MatrixXd* data,
                                LearningProblem* problem,
                                std::string* error) {
  const int state_size = 2 * options.num_oscillators + 4;
  if (data != nullptr) {
    if (!CheckDataShape(*data, state_size, error)) return false;
    problem->data = *data;
  } else {
    problem->data = NumpyRandom(static_cast<std::uint32_t>(options.data_seed))
                        .Rand(2 * options.num_samples, state_size);
    problem->data.array() = -1.0 + 2.0 * problem->data.array();
  }
  DataSet all;
  all.inputs = problem->data.transpose();
  all.contexts = all.inputs;
  all.targets = Eigen::MatrixXd::Zero(2 * options.horizon, all.num_samples());
  SplitSamples(all, 16, problem);
  problem->num_epochs = 25;
  problem->initialization = Initialization::kGlorotUniform;
  // Two oscillators, reference and force are nine variables: two passes of
  // Jets.
  if (options.num_oscillators == 2) {
    SetModel<2, 5>(options, problem);
  } else {
    SetModel<0, 8>(options, problem);
  }
  if (options.coupling == "linear") problem->metric = Regret(problem->model);
  return true;
}

}  // namespace invgrad
