#include "invgrad/train/training_memory.h"

#include <algorithm>
#include <numeric>

#include "ceres/solver.h"
#include "invgrad/chain/network_layers.h"
#include "invgrad/minimize/ceres_minimizer.h"

namespace invgrad {
namespace {

constexpr double kDouble = sizeof(double);

// A forward and a backward pass, and with feedback the network's input
// Jacobians with a buffer.
MemoryPart Activations(const Model& model, double batch_size) {
  double of_a_column = model.network().BytesPerColumn();
  if (model.num_calls() > 1) {
    const auto& widths = model.dense_network()->widths();
    of_a_column += 2.0 * kDouble *
                   *std::max_element(widths.begin(), widths.end()) *
                   model.network().num_outputs();
  }
  return {"activations", batch_size * model.num_columns() * of_a_column};
}

// `num_outputs`: the rows of J per sample, |y|, or |x| for a proxy.
JacobianSizes SizesOfJacobian(const Model& model,
                              double num_outputs,
                              double batch_size) {
  JacobianSizes J;
  J.rows = num_outputs * batch_size;
  J.cols = model.num_weights();
  if (!model.has_factors()) {
    for (const LayerColumns& layer : FactorLayersOf(model.network())) {
      J.sampled_layers.push_back({1.0 * layer.rows(), 1.0 * layer.cols()});
    }
    J.sampled_factor_bytes =
        model.network().FactorBytes(static_cast<int>(batch_size));
    return J;
  }
  const auto& widths = model.dense_network()->widths();
  for (int l = 0; l < model.dense_network()->num_layers(); ++l) {
    J.layers.push_back({widths[l] + 1.0, 1.0 * widths[l + 1]});
  }
  J.factor_bytes = kDouble * J.rows * model.num_columns() *
                   std::accumulate(widths.begin() + 1, widths.end() - 1, 0.0);
  return J;
}

// Model::Linearize in addition to the passes. (A closed loop has no Hessian.)
void AddLinearization(const Model& model,
                      bool with_hessian,
                      double batch_size,
                      std::vector<MemoryPart>* parts) {
  const double num_x = model.simulator().num_inputs();
  const double num_y = model.loss().size();
  const double n = model.num_weights();
  if (model.has_factors()) {
    parts->push_back({"Jacobians of the simulator",
                      kDouble * batch_size * (num_x + 2.0) * num_y});
  }
  if (with_hessian || !model.loss().SquaredNormFactor().has_value()) {
    parts->push_back(
        {"Hessians of the loss", kDouble * batch_size * num_y * num_y});
  }
  if (!with_hessian) return;
  parts->push_back({"Hessian", kDouble * n * n});
  parts->push_back({"gradients and Hessians in x of the samples",
                    kDouble * batch_size * (n + num_x * num_x)});
}

}  // namespace

double DataBytes(const DataSet& data) {
  return kDouble *
         static_cast<double>(data.inputs.size() + data.contexts.size() +
                             data.targets.size() + data.solutions.size());
}

std::vector<MemoryPart> TrainingMemory(const Model& model,
                                       const UpdateRule& rule,
                                       bool through_pull_back,
                                       int batch_size,
                                       int num_ranks) {
  const LinearizationParts needs = rule.Needs();
  const double num_outputs =
      through_pull_back ? model.simulator().num_inputs() : model.loss().size();
  JacobianSizes J = SizesOfJacobian(model, num_outputs, batch_size);
  J.num_ranks = num_ranks;
  std::vector<MemoryPart> parts = rule.StepMemory(J);
  const int own_size = (batch_size + num_ranks - 1) / num_ranks;
  parts.push_back(Activations(model, own_size));
  if (!needs.jacobian && !needs.hessian) return parts;
  if (!through_pull_back) {
    AddLinearization(model, needs.hessian, own_size, &parts);
    return parts;
  }
  // J of the proxy is that of the network.
  if (model.dense_network() == nullptr) return parts;
  // The proxy's Jacobian and Hessian in the network's outputs.
  const double bytes = kDouble * model.network().num_outputs() * J.rows;
  if (needs.jacobian) parts.push_back({"Jacobians of the proxy", bytes});
  if (needs.hessian) {
    parts.push_back({"Hessians of the proxy", bytes});
    parts.push_back({"Hessian", kDouble * J.cols * J.cols});
  }
  return parts;
}

std::vector<MemoryPart> CeresMemory(const Phase& phase,
                                    const Model& model,
                                    int num_samples) {
  std::vector<MemoryPart> parts = {Activations(model, num_samples)};
  if (!phase.ceres->is_trust_region) return parts;
  const ceres::Solver::Options options = phase.CeresOptions();
  const JacobianSizes J =
      SizesOfJacobian(model, model.loss().size(), num_samples);
  for (const MemoryPart& part :
       TrustRegionMemory(options.linear_solver_type, J.rows, J.cols)) {
    parts.push_back(part);
  }
  parts.push_back({"factors of J", J.factor_bytes});
  AddLinearization(model, false, num_samples, &parts);
  return parts;
}

}  // namespace invgrad
