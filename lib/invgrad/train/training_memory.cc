#include "invgrad/train/training_memory.h"

#include <algorithm>
#include <utility>

#include "ceres/solver.h"
#include "fmt/core.h"
#include "invgrad/minimize/ceres_minimizer.h"

namespace invgrad {

namespace {

constexpr double kDouble = sizeof(double);

double DataBytes(const DataSet& data) {
  return kDouble *
         static_cast<double>(data.inputs.size() + data.contexts.size() +
                             data.targets.size() + data.solutions.size());
}

double SumOfHiddenWidths(const DenseNetwork& network) {
  double sum = 0.0;
  for (int l = 1; l < network.num_layers(); ++l) sum += network.widths()[l];
  return sum;
}

double MaxWidth(const DenseNetwork& network) {
  return *std::max_element(network.widths().begin(), network.widths().end());
}

// Memory of a forward and a backward pass: inputs and slopes (and curvatures)
// of every layer, the outputs with their covectors, two buffers, and with
// feedback the network's input Jacobians with a buffer.
double PassBytes(const Model& model, double batch_size, bool with_curvatures) {
  const DenseNetwork& network = model.network();
  const double buffers = 2.0 * MaxWidth(network);
  double of_a_column =
      network.num_inputs() + 2.0 * network.num_outputs() +
      (with_curvatures ? 3.0 : 2.0) * SumOfHiddenWidths(network) + buffers;
  if (model.num_calls() > 1) of_a_column += buffers * network.num_outputs();
  return kDouble * batch_size * model.num_columns() * of_a_column;
}

// `num_outputs`: the rows of J per sample, |y|, or |x| for a proxy.
JacobianSizes SizesOfJacobian(const Model& model,
                              double num_outputs,
                              double batch_size) {
  const DenseNetwork& network = model.network();
  JacobianSizes J;
  J.rows = num_outputs * batch_size;
  J.cols = network.num_weights();
  for (int l = 0; l < network.num_layers(); ++l) {
    J.layers.push_back(
        {network.widths()[l] + 1.0, 1.0 * network.widths()[l + 1]});
  }
  J.factor_bytes =
      kDouble * J.rows * model.num_columns() * SumOfHiddenWidths(network);
  return J;
}

// Memory of Model::Linearize in addition to the passes.
void AddLinearization(const Model& model,
                      const LinearizationParts& needs,
                      double batch_size,
                      std::vector<MemoryPart>* parts) {
  const double num_x = model.simulator().num_inputs();
  const double num_y = model.loss().size();
  const double n = model.num_weights();
  parts->push_back({"Jacobians of the simulator",
                    kDouble * batch_size * (num_x + 2.0) * num_y});
  if (needs.hessian || !model.loss().SquaredNormFactor().has_value()) {
    parts->push_back(
        {"Hessians of the loss", kDouble * batch_size * num_y * num_y});
  }
  if (!needs.hessian) return;
  parts->push_back(
      {"Hessians of the samples in x", kDouble * batch_size * num_x * num_x});
  parts->push_back({"Hessian", kDouble * n * n});
  if (model.num_calls() > 1) {
    parts->push_back(
        {"Hessian of the closed loop",
         kDouble * batch_size * n * (3.0 * num_x + model.num_calls())});
  } else {
    parts->push_back({"gradients of the samples", kDouble * batch_size * n});
  }
}

void Append(const std::vector<MemoryPart>& more,
            std::vector<MemoryPart>* parts) {
  parts->insert(parts->end(), more.begin(), more.end());
}

}  // namespace

std::vector<MemoryPart> TrainingMemory(const Model& model,
                                       const UpdateRule& rule,
                                       bool through_pull_back,
                                       int batch_size) {
  const LinearizationParts needs = rule.Needs();
  const double num_outputs =
      through_pull_back ? model.simulator().num_inputs() : model.loss().size();
  const JacobianSizes J = SizesOfJacobian(model, num_outputs, batch_size);
  std::vector<MemoryPart> parts = {
      {"activations", PassBytes(model, batch_size, needs.hessian)}};
  if (through_pull_back) {
    // The proxy's Jacobian and Hessian in the network's outputs.
    const double width = model.network().num_outputs();
    if (needs.jacobian) {
      parts.push_back({"Jacobians of the proxy", kDouble * width * J.rows});
    }
    if (needs.hessian) {
      parts.push_back({"Hessians of the proxy", kDouble * width * J.rows});
      parts.push_back({"Hessian", kDouble * J.cols * J.cols});
    }
  } else if (needs.jacobian || needs.hessian) {
    AddLinearization(model, needs, batch_size, &parts);
  }
  Append(rule.StepMemory(J), &parts);
  return parts;
}

bool TrainingFits(const Model& model,
                  const TrainingData& data,
                  const UpdateRule& rule,
                  bool through_pull_back,
                  int batch_size,
                  double limit,
                  std::string* error) {
  std::vector<MemoryPart> parts =
      TrainingMemory(model, rule, through_pull_back, batch_size);
  parts.push_back(
      {"batch", DataBytes(data.train) * batch_size / data.train.num_samples()});
  parts.push_back({"data", DataBytes(data.train) + DataBytes(data.test)});
  return FitsInMemory(
      fmt::format("batch_size={}", batch_size), std::move(parts), limit, error);
}

bool CeresFits(const Phase& phase,
               const Model& model,
               const TrainingData& data,
               double limit,
               std::string* error) {
  const int num_samples = data.train.num_samples();
  std::vector<MemoryPart> parts;
  if (phase.ceres->is_trust_region) {
    const ceres::Solver::Options options = phase.CeresOptions();
    const JacobianSizes J =
        SizesOfJacobian(model, model.loss().size(), num_samples);
    parts = TrustRegionMemory(options.linear_solver_type, J.rows, J.cols);
    parts.push_back({"factors of J", J.factor_bytes});
    AddLinearization(model, {}, num_samples, &parts);
  }
  parts.push_back({"activations", PassBytes(model, num_samples, false)});
  parts.push_back({"data", DataBytes(data.train) + DataBytes(data.test)});
  return FitsInMemory(fmt::format("all {} samples at once", num_samples),
                      std::move(parts),
                      limit,
                      error);
}

}  // namespace invgrad
