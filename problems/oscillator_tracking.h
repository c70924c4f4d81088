// A chain of coupled oscillators whose last mass must follow a reference. The
// network chooses the force at every step: closed-loop control.
//
//   q' = v,   v' = the chain of oscillator_chain.h with the force u(t)
//   p(t) = a_1 + a_2,   a_i' = omega_i b_i,   b_i' = -omega_i a_i
//   s = (q, v, a_1, b_1, a_2, b_2),   u_t = f(s_t; theta),   t = 0 .. T-1
//   L = dt sum_t [weight_t (q_last(t+1) - p(t+1))^2 + control_weight u_t^2]
//
// weight_t is 1, and end_weight at the last step. The reference p is a mixture
// of two sinusoids, whose amplitudes and phases differ from sample to sample.
// The state includes the state of the reference's generator, so the network can
// anticipate the reference: a full-information regulator [1].
//
// Discretization: T = horizon steps of dt, u constant in a step; classical
//          Runge-Kutta (order 4) for the chain, the exact rotation for (a, b).
// Shapes:  state, network input: 2 num_oscillators + 4;  x = (u_0, ..): T;
//          y, of which L is the squared norm: 2 T, at each step the weighted
//          error and force.
// Data:    np.random.seed(data_seed); np.random.uniform(-1, 1, (2 N,
//          2 num_oscillators + 4)), the states at the start, the first N rows
//          for training, the others for testing.
// Metric:  with coupling=linear, regret: the mean L minus its minimum over all
//          forces, 0.4 by default, beside which controllers hardly differ.
// Facts:   coupling=linear is a linear-quadratic problem. The minimum is
//          s_0^T Pi_0 s_0 with the Riccati recursion
//            Pi_T = 0,   K_t = (R + B^T W B)^-1 B^T W A,   W = Pi_{t+1} + Q_t,
//            Pi_t = A^T W A - K_t^T (R + B^T W B) K_t
//          for s_{t+1} = A s_t + B u_t and L = sum_t s_{t+1}^T Q_t s_{t+1} +
//          R u_t^2. The best feedback, u_t = -K_t s_t, is linear in s but
//          differs from step to step towards the end of the horizon. Any other
//          force costs sum_t (R + B^T W B) (u_t + K_t s_t)^2 more: the regret,
//          at O(T) a sample.
// Source:  none for the setting; for the chain see oscillator_chain.h.
//
// [1] Francis. The linear multivariable regulator problem. SIAM Journal on
//     Control and Optimization 15 (1977).
#ifndef PROBLEMS_OSCILLATOR_TRACKING_H_
#define PROBLEMS_OSCILLATOR_TRACKING_H_

#include <cmath>
#include <memory>
#include <string>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/compare/sample_data.h"
#include "invgrad/internal/trajectory_simulator.h"
#include "invgrad/loss.h"
#include "problems/oscillator_chain.h"

namespace invgrad {

// `data`: states at the start, one a row.
struct OscillatorTracking {
  // omega_1 and omega_2: below and above the chain's own frequencies, 1 for the
  // masses in phase and 1.18 against each other (two linear oscillators).
  static constexpr double kFrequencies[2] = {0.5, 1.5};

  std::string coupling = "linear";
  int num_oscillators = 2;
  int horizon = 24;
  double dt = 0.25;
  double control_weight = 0.01;
  double end_weight = 1.0;
  int num_samples = 1024;
  int data_seed = 0;
  void Describe(OptionSet* set) {
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

  // Chain and reference.
  template <int kNumOscillators>
  struct Step {
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
  struct Terms {
    int num_oscillators;
    int horizon;
    double error_factor;
    double end_factor;
    double force_factor;

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

  bool Create(LearningProblem* problem, std::string* error) const {
    const SampleSize sample_size = {
        num_samples,
        StateSize(),
        2.0 * (StateSize() + horizon),
        fmt::format(
            ":num_oscillators={}:horizon={}", num_oscillators, horizon)};
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
    num_oscillators == 2 ? SetModel<2, 5>(problem) : SetModel<0, 8>(problem);
    if (coupling == "linear") problem->metric = MakeRegret();
    return true;
  }

 private:
  int StateSize() const { return 2 * num_oscillators + 4; }

  template <int kNumOscillators>
  Step<kNumOscillators> MakeStep() const {
    Step<kNumOscillators> step;
    if (coupling == "cubic") {
      step.chain = {num_oscillators, dt, 0.0, 1.0, 3.0};
    } else {
      step.chain = {num_oscillators, dt, 0.2, 0.0, 1.0};
    }
    for (int i = 0; i < 2; ++i) {
      step.cosine[i] = std::cos(kFrequencies[i] * dt);
      step.sine[i] = std::sin(kFrequencies[i] * dt);
    }
    return step;
  }

  Terms MakeTerms() const {
    return {num_oscillators,
            horizon,
            std::sqrt(dt),
            std::sqrt(dt * end_weight),
            std::sqrt(dt * control_weight)};
  }

  template <int kNumOscillators, int kStride>
  void SetModel(LearningProblem* problem) const {
    const auto simulator = std::make_shared<
        TrajectorySimulator<Step<kNumOscillators>, Terms, kStride>>(
        MakeStep<kNumOscillators>(), MakeTerms(), StateSize(), 1, 2, horizon);
    problem->model = std::make_shared<Model>(
        DenseNetwork({StateSize(), 16, 16, 1}, Activation::kTanh),
        simulator,
        std::make_shared<SquaredNormLoss>(simulator->num_outputs(), 1.0),
        Reduction::kMean,
        simulator);
  }

  // The best feedback of the linear problem, computed backwards from the end of
  // the horizon (Facts above), and the cost of deviations from it.
  struct Regulator {
    Eigen::MatrixXd A;          // ns x ns, s_{t+1} = A s_t + B u_t
    Eigen::VectorXd B;          // ns
    Eigen::MatrixXd gains;      // ns x T, column t is K_t^T
    Eigen::VectorXd curvature;  // T, R + B^T W B

    explicit Regulator(const OscillatorTracking& problem)
        : A(problem.StateSize(), problem.StateSize()),
          B(problem.StateSize()),
          gains(problem.StateSize(), problem.horizon),
          curvature(problem.horizon) {
      const Step<0> step = problem.MakeStep<0>();
      const Eigen::Index ns = B.size();
      const Eigen::MatrixXd units = Eigen::MatrixXd::Identity(ns, ns);
      const Eigen::VectorXd rest = Eigen::VectorXd::Zero(ns);
      const double no_force = 0.0;
      const double unit_force = 1.0;
      for (Eigen::Index i = 0; i < ns; ++i) {
        step(units.col(i).data(), &no_force, A.col(i).data());
      }
      step(rest.data(), &unit_force, B.data());
      const Terms terms = problem.MakeTerms();
      const double R = terms.force_factor * terms.force_factor;
      const int n = problem.num_oscillators;
      // q_last - p
      const Eigen::VectorXd error =
          units.col(n - 1) - units.col(2 * n) - units.col(2 * n + 2);
      Eigen::MatrixXd Pi = Eigen::MatrixXd::Zero(ns, ns);
      for (int t = problem.horizon - 1; t >= 0; --t) {
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

  Metric MakeRegret() const {
    const auto regulator = std::make_shared<const Regulator>(*this);
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
};

}  // namespace invgrad

#endif  // PROBLEMS_OSCILLATOR_TRACKING_H_
