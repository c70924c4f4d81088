// The functions of SteppedSimulator for batches.

#include <functional>

#include "invgrad/internal/lanes.h"
#include "invgrad/internal/scratch.h"
#include "invgrad/internal/stepped_simulator.h"

namespace invgrad {

bool SteppedSimulator::EvaluateLanes(const double* x,
                                     const double* contexts,
                                     double* y,
                                     double* jacobians) const {
  const Index num_x = num_inputs();
  const Index num_y = num_outputs();
  const Index rows = state_size_ + output_size_;
  const Index G_size = jacobians == nullptr
                           ? 0
                           : num_steps_ * rows * (state_size_ + control_size_);
  Scratch<Pack> memory(num_x + state_size_ + num_y + G_size);
  Pack* const x_packs = memory.data();
  Pack* const start = x_packs + num_x;
  Pack* const y_packs = start + state_size_;
  Pack* const G = G_size == 0 ? nullptr : y_packs + num_y;
  LoadLanes(x, num_x, x_packs);
  LoadLanes(contexts, state_size_, start);
  if (!RollOut<Pack>(x_packs, start, rows, y_packs, nullptr, G)) return false;
  StoreLanes(y_packs, num_y, y);
  if (G == nullptr) return true;
  if (output_size_ == 0 && ChainsInLanes()) {
    Scratch<Pack> jacobian(JacobianSize());
    ChainToEnd(G, jacobian.data());
    StoreLanes(jacobian.data(), JacobianSize(), jacobians);
  } else {
    // BLAS is faster.
    Scratch<double> G_lanes(Pack::kLanes * G_size);
    StoreLanes(G, G_size, G_lanes.data());
    for (int lane = 0; lane < Pack::kLanes; ++lane) {
      double* const jacobian = jacobians + lane * JacobianSize();
      if (output_size_ == 0) {
        ChainToEnd<double>(G_lanes.data() + lane * G_size, jacobian);
      } else {
        ChainToOutputs(G_lanes.data() + lane * G_size, jacobian);
      }
    }
  }
  return AllFinite(jacobians, Pack::kLanes * JacobianSize());
}

int SteppedSimulator::EvaluateBatch(int count,
                                    const double* x,
                                    const double* contexts,
                                    double* y,
                                    double* jacobians) const {
  const auto evaluate = [&](int s, const auto& function) {
    return function(
        x + Index{s} * num_inputs(),
        contexts + Index{s} * state_size_,
        y + Index{s} * num_outputs(),
        jacobians == nullptr ? nullptr : jacobians + s * JacobianSize());
  };
  return ForSamplesInLanes(
      count,
      WhyNoLanes().empty(),
      [&](int s) {
        return evaluate(s, [this](auto... a) { return EvaluateLanes(a...); });
      },
      [&](int s) {
        return evaluate(s, [this](auto... a) { return Evaluate(a...); });
      });
}

bool SteppedSimulator::AdjointLanes(int first,
                                    const double* x,
                                    const double* contexts,
                                    const BatchCovector& covector,
                                    double* x_bar) const {
  const Index num_x = num_inputs();
  const Index num_y = num_outputs();
  const Index rows = state_size_ + output_size_;
  const Index G_size = num_steps_ * rows * (state_size_ + control_size_);
  Scratch<Pack> memory(2 * num_x + state_size_ + 2 * num_y + G_size);
  Pack* const x_packs = memory.data();
  Pack* const start = x_packs + num_x;
  Pack* const y_packs = start + state_size_;
  Pack* const w_packs = y_packs + num_y;
  Pack* const x_bar_packs = w_packs + num_y;
  Pack* const G = x_bar_packs + num_x;
  LoadLanes(x, num_x, x_packs);
  LoadLanes(contexts, state_size_, start);
  if (!RollOut<Pack>(x_packs, start, rows, y_packs, nullptr, G)) return false;
  Scratch<double> y_and_w(2 * Pack::kLanes * num_y);
  double* const y = y_and_w.data();
  double* const w = y + Pack::kLanes * num_y;
  StoreLanes(y_packs, num_y, y);
  for (int lane = 0; lane < Pack::kLanes; ++lane) {
    if (!covector(first + lane, y + lane * num_y, w + lane * num_y)) {
      return false;
    }
  }
  LoadLanes(w, num_y, w_packs);
  if (!ChainBack<Pack>(G, w_packs, x_bar_packs)) return false;
  StoreLanes(x_bar_packs, num_x, x_bar);
  return true;
}

int SteppedSimulator::AdjointBatch(int count,
                                   const double* x,
                                   const double* contexts,
                                   const BatchCovector& covector,
                                   double* x_bar) const {
  Scratch<double> y(num_outputs());
  int sample = 0;
  const auto of_sample = [&](const double* at, double* w) {
    return covector(sample, at, w);
  };
  const Covector sample_covector = std::cref(of_sample);
  return ForSamplesInLanes(
      count,
      WhyNoLanes().empty(),
      [&](int s) {
        return AdjointLanes(s,
                            x + Index{s} * num_inputs(),
                            contexts + Index{s} * state_size_,
                            covector,
                            x_bar + Index{s} * num_inputs());
      },
      [&](int s) {
        sample = s;
        return Adjoint(x + Index{s} * num_inputs(),
                       contexts + Index{s} * state_size_,
                       sample_covector,
                       y.data(),
                       x_bar + Index{s} * num_inputs());
      });
}

int SteppedSimulator::AdvanceBatch(int count,
                                   const double* states,
                                   const double* controls,
                                   double* next_states) const {
  const Index ns = state_size_;
  const Index nc = control_size_;
  Scratch<Pack> memory(ns + nc);
  Pack* const state = memory.data();
  Pack* const control = state + ns;
  return ForSamplesInLanes(
      count,
      WhyNoLanes().empty(),
      [&](int s) {
        LoadLanes(states + s * ns, ns, state);
        LoadLanes(controls + s * nc, nc, control);
        if (!Steps(0, 1, control, ns, state, nullptr, nullptr, nullptr)) {
          return false;
        }
        StoreLanes(state, ns, next_states + s * ns);
        return AreLanesFinite(state, ns);
      },
      [&](int s) {
        return Advance(
            states + s * ns, controls + s * nc, next_states + s * ns);
      });
}

int SteppedSimulator::StepJacobiansBatch(int count,
                                         const double* x,
                                         const double* starts,
                                         double* M) const {
  const Index ns = state_size_;
  const Index num_x = num_inputs();
  const Index M_size = num_steps_ * ns * (ns + control_size_);
  Scratch<Pack> memory(num_x + 2 * ns + M_size);
  Pack* const x_packs = memory.data();
  Pack* const start = x_packs + num_x;
  Pack* const end = start + ns;
  Pack* const M_packs = end + ns;
  return ForSamplesInLanes(
      count,
      WhyNoLanes().empty(),
      [&](int s) {
        LoadLanes(x + s * num_x, num_x, x_packs);
        LoadLanes(starts + s * ns, ns, start);
        if (!RollOut<Pack>(x_packs, start, ns, end, nullptr, M_packs)) {
          return false;
        }
        StoreLanes(M_packs, M_size, M + s * M_size);
        return true;
      },
      [&](int s) {
        return StepJacobians(x + s * num_x, starts + s * ns, M + s * M_size);
      });
}

}  // namespace invgrad
