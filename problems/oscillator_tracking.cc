#include "problems/oscillator_tracking.h"

#include <cmath>
#include <memory>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/chain/loss.h"
#include "invgrad/chain/trajectory_simulator.h"
#include "problems/oscillator_chain.h"
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
    const int chain_size = 2 * chain.count();
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

  double ErrorFactor(int t) const {
    return t + 1 == horizon ? end_factor : error_factor;
  }

  template <typename T>
  bool operator()(int t, const T* next_state, const T* u, T* terms) const {
    const T& position = next_state[num_oscillators - 1];
    const T* reference = next_state + 2 * num_oscillators;
    terms[0] = ErrorFactor(t) * (position - (reference[0] + reference[2]));
    terms[1] = force_factor * u[0];
    return true;
  }
};

int StateSize(const OscillatorTracking& options) {
  return 2 * options.num_oscillators + 4;
}

template <int kNumOscillators>
TrackingStep<kNumOscillators> MakeStep(const OscillatorTracking& options) {
  using Chain = OscillatorStep<kNumOscillators>;
  const int n = options.num_oscillators;
  TrackingStep<kNumOscillators> step;
  step.chain = options.coupling == "cubic"
                   ? Chain{n, options.dt, 0.0, 1.0, 3.0}
                   : Chain{n, options.dt, 0.2, 0.0, 1.0};
  for (int i = 0; i < 2; ++i) {
    const double angle = OscillatorTracking::kFrequencies[i] * options.dt;
    step.cosine[i] = std::cos(angle);
    step.sine[i] = std::sin(angle);
  }
  return step;
}

TrackingTerms MakeTerms(const OscillatorTracking& options) {
  return {options.num_oscillators,
          options.horizon,
          std::sqrt(options.dt),
          std::sqrt(options.dt * options.end_weight),
          std::sqrt(options.dt * options.control_weight)};
}

template <int kNumOscillators, int kStride>
void SetModel(const OscillatorTracking& options, LearningProblem* problem) {
  const int state_size = StateSize(options);
  const auto simulator =
      std::make_shared<TrajectorySimulator<TrackingStep<kNumOscillators>,
                                           TrackingTerms,
                                           kStride>>(
          MakeStep<kNumOscillators>(options),
          MakeTerms(options),
          state_size,
          1,
          2,
          options.horizon);
  problem->model = std::make_shared<Model>(
      DenseNetwork({state_size, 16, 16, 1}, Activation::kTanh),
      simulator,
      std::make_shared<SquaredNormLoss>(simulator->num_outputs(), 1.0),
      Reduction::kMean,
      simulator);
}

// The best feedback of the linear problem, computed backwards from the end of
// the horizon (Facts of the header), and the cost of deviations from it.
struct Regulator {
  Eigen::MatrixXd A;          // ns x ns, s_{t+1} = A s_t + B u_t
  Eigen::VectorXd B;          // ns
  Eigen::MatrixXd gains;      // ns x T, column t is K_t^T
  Eigen::VectorXd curvature;  // T, R + B^T W B

  explicit Regulator(const OscillatorTracking& options)
      : A(StateSize(options), StateSize(options)),
        B(StateSize(options)),
        gains(StateSize(options), options.horizon),
        curvature(options.horizon) {
    const TrackingStep<0> step = MakeStep<0>(options);
    const TrackingTerms terms = MakeTerms(options);
    const double R = terms.force_factor * terms.force_factor;
    const Eigen::Index ns = B.size();
    const Eigen::MatrixXd units = Eigen::MatrixXd::Identity(ns, ns);
    const Eigen::VectorXd rest = Eigen::VectorXd::Zero(ns);
    const double no_force = 0.0;
    const double unit_force = 1.0;
    for (Eigen::Index i = 0; i < ns; ++i) {
      step(units.col(i).data(), &no_force, A.col(i).data());
    }
    step(rest.data(), &unit_force, B.data());
    Eigen::MatrixXd Pi = Eigen::MatrixXd::Zero(ns, ns);
    const int n = options.num_oscillators;
    Eigen::VectorXd error = Eigen::VectorXd::Zero(ns);  // q_last - p
    error[n - 1] = 1.0;
    error[2 * n] = error[2 * n + 2] = -1.0;
    for (int t = options.horizon - 1; t >= 0; --t) {
      const Eigen::VectorXd row = terms.ErrorFactor(t) * error;
      const Eigen::MatrixXd W = Pi + row * row.transpose();
      curvature[t] = R + B.dot(W * B);
      // If the curvature is zero, no force changes the loss.
      gains.col(t).setZero();
      if (curvature[t] > 0.0) {
        gains.col(t) = A.transpose() * (W * B) / curvature[t];
      }
      // A^T W A - K^T (R + B^T W B) K as a sum of squares (Joseph's form): it
      // stays symmetric and positive for any horizon.
      const Eigen::MatrixXd closed = A - B * gains.col(t).transpose();
      Pi = closed.transpose() * W * closed +
           R * gains.col(t) * gains.col(t).transpose();
    }
  }

  // L - s_0^T Pi_0 s_0 as a sum of squares, which avoids cancellation:
  // sum_t (R + B^T W B) (u_t + K_t s_t)^2.
  double Regret(const Eigen::VectorXd& x, Eigen::VectorXd state) const {
    double sum = 0.0;
    for (Eigen::Index t = 0; t < x.size(); ++t) {
      const double deviation = x[t] + gains.col(t).dot(state);
      sum += curvature[t] * deviation * deviation;
      state = A * state + B * x[t];
    }
    return sum;
  }
};

Metric RegretMetric(const OscillatorTracking& options) {
  const auto regulator = std::make_shared<const Regulator>(options);
  const auto evaluate = [regulator](const Eigen::MatrixXd& x,
                                    const DataSet& data) {
    CHECK_EQ(x.cols(), data.num_samples());
    CHECK_EQ(x.rows(), regulator->curvature.size());
    double sum = 0.0;
    for (int s = 0; s < data.num_samples(); ++s) {
      sum += regulator->Regret(x.col(s), data.contexts.col(s));
    }
    return sum / data.num_samples();
  };
  return {"regret", evaluate};
}

}  // namespace

void OscillatorTracking::Describe(OptionSet* set) {
  set->Add("coupling",
           &coupling,
           {"linear", "cubic"},
           "of neighbours, as in oscillator_chain");
  set->Add("num_oscillators",
           &num_oscillators,
           {2, kMaxOscillators},
           "length of the chain");
  set->Add("horizon", &horizon, {1, 1e5}, "steps, T");
  set->Add("dt", &dt, {1e-9, 1}, "length of a step");
  set->Add("control_weight",
           &control_weight,
           {0, 1e6},
           "weight of the squared force");
  set->Add("end_weight",
           &end_weight,
           {0, 1e6},
           "weight of the last squared error; of the others: 1");
  DescribeSamples(1, 1e7, &num_samples, &data_seed, set);
}

bool OscillatorTracking::Create(LearningProblem* problem,
                                std::string* error) const {
  const int state_size = StateSize(*this);
  const SampleSize sample_size = {
      num_samples,
      state_size,
      2.0 * (state_size + horizon),
      fmt::format(":num_oscillators={}:horizon={}", num_oscillators, horizon)};
  if (!MakeUniformData(sample_size, -1.0, 1.0, data_seed, problem, error)) {
    return false;
  }
  DataSet all;
  all.inputs = problem->data.transpose();
  all.contexts = all.inputs;
  all.targets = Eigen::MatrixXd::Zero(2 * horizon, all.num_samples());
  SplitSamples(all, 16, problem);
  problem->num_epochs = 25;
  // The step for two oscillators, reference and force has nine variables: two
  // passes of Jets.
  num_oscillators == 2 ? SetModel<2, 5>(*this, problem)
                       : SetModel<0, 8>(*this, problem);
  if (coupling == "linear") problem->metric = RegretMetric(*this);
  return true;
}

}  // namespace invgrad
