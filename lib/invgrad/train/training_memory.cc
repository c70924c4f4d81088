#include "invgrad/train/training_memory.h"

#include <algorithm>
#include <numeric>

#include "ceres/solver.h"
#include "invgrad/core/step_cost.h"
#include "invgrad/method.h"
#include "invgrad/methods/ceres_methods.h"
#include "invgrad/minimize/ceres_minimizer.h"

namespace invgrad {
namespace {

constexpr double kDouble = sizeof(double);

// A forward and a backward pass, and with feedback the network's input
// Jacobians with a buffer.
MemoryPart Activations(const Model& model, double batch_size) {
  double of_a_column = model.network().bytes_per_column();
  if (model.num_calls() > 1) {
    const auto& widths = model.dense_network()->widths();
    of_a_column += 2.0 * kDouble *
                   *std::max_element(widths.begin(), widths.end()) *
                   model.network().num_outputs();
  }
  return {"activations", batch_size * model.num_columns() * of_a_column};
}

MemoryPart FactorsOfJacobian(const Model& model, double num_rows) {
  if (model.dense_network() == nullptr) return {"factors of J", 0.0};
  const auto& widths = model.dense_network()->widths();
  return {"factors of J",
          kDouble * num_rows * model.num_columns() *
              std::accumulate(widths.begin() + 1, widths.end() - 1, 0.0)};
}

// What the samples' simulators and losses give for J and the Hessian.
MemoryPart DerivativesOfSamples(const Model& model,
                                bool with_hessian,
                                double batch_size) {
  const double num_x = model.simulator().num_inputs();
  const double num_y = model.loss().size();
  double of_a_sample = model.has_factors() ? (num_x + 2.0) * num_y : 0.0;
  if (with_hessian || !model.loss().SquaredNormFactor().has_value()) {
    of_a_sample += num_y * num_y;
  }
  if (with_hessian) of_a_sample += num_x * num_x + model.num_weights();
  return {"derivatives of the samples", kDouble * batch_size * of_a_sample};
}

}  // namespace

double DataBytes(const DataSet& data) {
  return kDouble *
         static_cast<double>(data.inputs.size() + data.contexts.size() +
                             data.targets.size() + data.solutions.size());
}

std::vector<MemoryPart> TrainingMemory(const Model& model,
                                       const LinearizationParts& needs,
                                       bool through_pull_back,
                                       int batch_size,
                                       int num_ranks) {
  const double num_outputs =
      through_pull_back ? model.simulator().num_inputs() : model.loss().size();
  std::vector<MemoryPart> parts = StepMemory(needs,
                                             num_outputs * batch_size,
                                             model.num_weights(),
                                             /*num_entries=*/0.0,
                                             num_ranks);
  const int own_size = (batch_size + num_ranks - 1) / num_ranks;
  parts.push_back(Activations(model, own_size));
  if (!needs.jacobian && !needs.hessian) return parts;
  // Products need no factors.
  if (needs.jacobian && needs.num_products == 0 &&
      (through_pull_back || model.has_factors())) {
    parts.push_back(FactorsOfJacobian(model, num_outputs * own_size));
  }
  if (needs.factorization && !through_pull_back && !model.has_factors()) {
    parts.push_back(
        {"J", kDouble * num_outputs * own_size * model.num_weights()});
  }
  if (!through_pull_back) {
    parts.push_back(DerivativesOfSamples(model, needs.hessian, own_size));
  } else if (model.dense_network() != nullptr) {
    // J of the proxy is that of the network.
    parts.push_back({"derivatives of the proxy",
                     kDouble * num_outputs * num_outputs * own_size});
  }
  return parts;
}

std::vector<MemoryPart> CopiesOfState(const LinearizationParts& needs,
                                      int num_weights,
                                      bool is_raced,
                                      bool has_checkpoint) {
  // Where the loss was lowest, where the race began, and after three slices
  // (raced_engine.h).
  constexpr double kNumInRace = 5.0;
  const double bytes = MatrixBytes(needs, num_weights);
  std::vector<MemoryPart> parts;
  if (is_raced) parts.push_back({"states of a race", kNumInRace * bytes});
  if (has_checkpoint) {
    parts.push_back(
        {"checkpoint", (is_raced ? 1.0 + kNumInRace : 1.0) * bytes});
  }
  return parts;
}

std::vector<MemoryPart> CeresMemory(const Phase& phase,
                                    const Model& model,
                                    int num_samples) {
  std::vector<MemoryPart> parts = {Activations(model, num_samples)};
  if (!phase.ceres->is_trust_region) return parts;
  const double num_rows = 1.0 * model.loss().size() * num_samples;
  for (const MemoryPart& part :
       TrustRegionMemory(phase.CeresOptions().linear_solver_type,
                         num_rows,
                         model.num_weights())) {
    parts.push_back(part);
  }
  parts.push_back(FactorsOfJacobian(model, num_rows));
  parts.push_back(DerivativesOfSamples(model, false, num_samples));
  return parts;
}

}  // namespace invgrad
