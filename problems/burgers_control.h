// Control of Burgers' equation: the network chooses the force field of every
// time step, such that a given state is reached at the end with little force.
//
//   u_t + u u_x = nu u_xx + f,   periodic on [0, 1],   nu = 0.003
//   f_t = N(u_t, t, u*; theta),   constant over a step,   t = 0 .. T-2
//   L = 1/n |u_T - u*|^2 + control_weight dt / n sum_t |f_t|^2
//
// The last step has no force: otherwise a force that costs next to nothing could
// jump from any state to u*.
//
// Discretization: n = num_cells finite volumes; T = horizon steps of
//          dt = 0.96 / T, each of substeps of Euler's method (order 1) that are
//          stable up to |u| = 6; the flux of Engquist and Osher [1] (order 1),
//            F(l, r) = 1/4 (l (l + |l|) + r (r - |r|)),
//          with sqrt(u^2 + 0.01) for |u|, so that second derivatives exist.
// Shapes:  state (u, clock t / T): n + 1;  network input (u, clock, u*): 2 n +
//          1;  x = (f_0, .., f_{T-1}), the last without effect: T n;  y, of
//          which n L is the squared distance from (0, .., 0, u*): T n, the
//          weighted forces but the last, and u_T.
// Data:    np.random.seed(data_seed); np.random.uniform(0, 1, (2 N, 9)). u_0 is
//          the sum of two Gaussians that run towards each other, of amplitudes
//          in [0, 3] and [-3, 0], centres in [0.2, 0.4] and [0.6, 0.8] and
//          widths in [0.05, 0.15]. u* is u_T under a constant Gaussian force,
//          of amplitude in [-1.6, 1.6], centre in [0.4, 0.6] and width in [0.1,
//          0.4]; x* is that force. The first N rows are for training, the
//          others for testing.
// Metric:  end_error: 1/n |u_T - u*|^2, the first part of L.
// Facts:   the mean of u changes by dt times the mean of the forces, exactly.
//          Without force max |u| does not grow. L(x*) is the second part of L
//          alone: no controller needs to be worse.
// Source:  PBDL, chapters diffphys-control and reinflearn-code; Holl, Koltun,
//          Thuerey. Learning to Control PDEs with Differentiable Physics. ICLR
//          2020, arXiv 2001.07457. There: 32 steps, advection by
//          semi-Lagrangian look-up, an open boundary, a convolutional network,
//          and another weight of the force.
//
// [1] Engquist, Osher. One-sided difference approximations for nonlinear
//     conservation laws. Mathematics of Computation 36 (1981).
#ifndef PROBLEMS_BURGERS_CONTROL_H_
#define PROBLEMS_BURGERS_CONTROL_H_

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/compare/sample_data.h"
#include "invgrad/internal/trajectory_simulator.h"
#include "invgrad/loss.h"

namespace invgrad {

// `data`: the nine numbers of a sample in [0, 1], one sample a row.
struct BurgersControl {
  static constexpr double kViscosity = 0.003;
  static constexpr double kEndTime = 0.96;
  static constexpr int kMaxNumCells = 64;

  int num_cells = 16;
  int horizon = 4;
  double control_weight = 0.03;
  int num_samples = 512;
  int data_seed = 0;
  void Describe(OptionSet* set) {
    set->Add("num_cells", &num_cells, {3, kMaxNumCells}, "cells, n");
    set->Add("horizon", &horizon, {2, 1000}, "steps, T");
    set->Add("control_weight",
             &control_weight,
             {0, 1e6},
             "weight of the squared force");
    DescribeSamples(1, 1e6, &num_samples, &data_seed, set);
  }

  // From (u_t, t / T) to (u_{t+1}, (t + 1) / T).
  struct Step {
    int num_cells = 0;
    int horizon = 0;
    double dt = 0.0;
    double viscosity = 0.0;
    int num_substeps = 0;

    template <typename T>
    bool operator()(const T* state, const T* force, T* next_state) const {
      using std::sqrt;
      const int n = num_cells;
      const double per_cell = n * dt / num_substeps;
      const bool is_last = state[n] > 1.0 - 1.5 / horizon;
      T* const u = next_state;
      std::copy_n(state, n, u);
      next_state[n] = state[n] + 1.0 / horizon;
      // The parts of the flux between two cells: of the left, of the right one.
      T from_left[kMaxNumCells];
      T from_right[kMaxNumCells];
      for (int k = 0; k < num_substeps; ++k) {
        for (int i = 0; i < n; ++i) {
          const T speed = sqrt(u[i] * u[i] + 0.01);
          from_left[i] = u[i] * (0.25 * (u[i] + speed) + viscosity * n);
          from_right[i] = u[i] * (0.25 * (u[i] - speed) - viscosity * n);
        }
        for (int i = 0; i < n; ++i) {
          const T in = from_left[i == 0 ? n - 1 : i - 1] + from_right[i];
          const T out = from_left[i] + from_right[i == n - 1 ? 0 : i + 1];
          u[i] += per_cell * (in - out);
          if (!is_last) u[i] += dt / num_substeps * force[i];
        }
      }
      return true;
    }
  };

  struct Terms {
    int num_cells;
    int horizon;
    double force_factor;

    template <typename T>
    bool operator()(int t,
                    const T* next_state,
                    const T* force,
                    T* terms) const {
      for (int i = 0; i < num_cells; ++i) {
        terms[i] = t + 1 < horizon ? force_factor * force[i] : next_state[i];
      }
      return true;
    }
  };

  Step MakeStep() const {
    constexpr double kMaxSpeed = 6.0;
    const double dt = kEndTime / horizon;
    const double rate =
        num_cells * (kMaxSpeed + 2.0 * num_cells * kViscosity);  // 1 / time
    return {num_cells,
            horizon,
            dt,
            kViscosity,
            static_cast<int>(std::ceil(dt * rate))};
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    const int n = num_cells;
    const SampleSize sample_size = {
        num_samples,
        9,
        3.0 * n + 2.0 * n * horizon,
        fmt::format(":num_cells={}:horizon={}", num_cells, horizon)};
    if (!MakeUniformData(sample_size, 0.0, 1.0, data_seed, problem, error)) {
      return false;
    }
    const Step step = MakeStep();
    const double force_factor = std::sqrt(control_weight * step.dt);
    const auto simulator =
        std::make_shared<TrajectorySimulator<Step, Terms, 8>>(
            step, Terms{n, horizon, force_factor}, n + 1, n, n, horizon);
    problem->model = std::make_shared<Model>(
        DenseNetwork({2 * n + 1, 32, 32, n}, Activation::kTanh),
        simulator,
        std::make_shared<SquaredNormLoss>(horizon * n, 1.0 / n),
        Reduction::kMean,
        simulator);
    const DataSet all = MakeSamples(problem->data, *simulator);
    if (!all.targets.allFinite()) {
      *error = "a state at the end, under the force of the data, is not finite";
      return false;
    }
    SplitSamples(all, 8, problem);
    problem->num_epochs = 10;
    problem->metric = {
        "end_error",
        [simulator, n](const Eigen::MatrixXd& x, const DataSet& data) {
          Eigen::MatrixXd y(simulator->num_outputs(), x.cols());
          for (Eigen::Index s = 0; s < x.cols(); ++s) {
            const auto context = data.Context(static_cast<int>(s));
            if (!simulator->Evaluate(x.col(s).data(),
                                     context.data(),
                                     y.col(s).data(),
                                     nullptr)) {
              y.col(s).setConstant(std::nan(""));
            }
          }
          return (y - data.targets).bottomRows(n).squaredNorm() /
                 static_cast<double>(n * x.cols());
        }};
    return true;
  }

 private:
  // At the centres of the cells; periodic.
  Eigen::VectorXd Gaussian(double amplitude,
                           double centre,
                           double width) const {
    return Eigen::VectorXd::NullaryExpr(num_cells, [=](Eigen::Index i) {
      const double x = (i + 0.5) / num_cells - centre;
      const double distance = (x - std::round(x)) / width;
      return amplitude * std::exp(-0.5 * distance * distance);
    });
  }

  DataSet MakeSamples(const Eigen::MatrixXd& uniform,
                      const Simulator& simulator) const {
    const Eigen::Index n = num_cells;
    const Eigen::Index N = uniform.rows();
    DataSet all;
    all.inputs.setZero(2 * n + 1, N);
    all.solutions.setZero(horizon * n, N);
    all.targets.setZero(horizon * n, N);
    Eigen::VectorXd y(horizon * n);
    for (Eigen::Index s = 0; s < N; ++s) {
      const auto r = uniform.row(s);
      all.inputs.col(s).head(n) =
          Gaussian(3.0 * r[0], 0.2 + 0.2 * r[1], 0.05 + 0.1 * r[2]) -
          Gaussian(3.0 * r[3], 0.6 + 0.2 * r[4], 0.05 + 0.1 * r[5]);
      const Eigen::VectorXd force = Gaussian(
          1.6 * (2.0 * r[6] - 1.0), 0.4 + 0.2 * r[7], 0.1 + 0.3 * r[8]);
      all.solutions.col(s).head((horizon - 1) * n) =
          force.replicate(horizon - 1, 1);
      const bool is_finite = simulator.Evaluate(all.solutions.col(s).data(),
                                                all.inputs.col(s).data(),
                                                y.data(),
                                                nullptr);
      if (!is_finite) y.setConstant(std::nan(""));
      all.targets.col(s).tail(n) = y.tail(n);
      all.inputs.col(s).tail(n) = y.tail(n);
    }
    all.contexts = all.inputs.topRows(n + 1);
    return all;
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_BURGERS_CONTROL_H_
