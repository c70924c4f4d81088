#include "invgrad/equations/equation_cost.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "invgrad/cost.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

EquationCostFunction::EquationCostFunction(const Equation& equation,
                                           DataSet samples)
    : model_(EquationModel(equation)),
      samples_(std::move(samples)),
      layout_(dynamic_cast<const EquationSimulator&>(model_.simulator())
                  .context_layout()) {
  CHECK_EQ(samples_.contexts.rows(), layout_.size);
  set_num_residuals(model_.loss().size() * samples_.num_samples());
  *mutable_parameter_block_sizes() = model_.network().WeightBlocks();
  mutable_parameter_block_sizes()->resize(
      parameter_block_sizes().size() + layout_.num_coefficients, 1);
}

bool EquationCostFunction::Evaluate(double const* const* parameters,
                                    double* residuals,
                                    double** jacobians) const {
  const std::size_t num_blocks = model_.network().WeightBlocks().size();
  DataSet samples = samples_;
  for (int i = 0; i < layout_.num_coefficients; ++i) {
    samples.contexts.row(layout_.coefficients + i)
        .setConstant(*parameters[num_blocks + i]);
  }
  if (!ModelCost(model_, samples).Evaluate(parameters, residuals, jacobians)) {
    return false;
  }
  if (jacobians == nullptr ||
      std::all_of(jacobians + num_blocks,
                  jacobians + parameter_block_sizes().size(),
                  [](const double* J) { return J == nullptr; })) {
    return true;
  }
  VectorXd weights(model_.num_weights());
  double* weight = weights.data();
  for (std::size_t b = 0; b < num_blocks; ++b) {
    weight = std::copy_n(parameters[b], parameter_block_sizes()[b], weight);
  }
  const auto& simulator =
      dynamic_cast<const EquationSimulator&>(model_.simulator());
  const auto pass = model_.network().NewPass();
  std::string error;
  if (!model_.Forward(
          weights, samples, Network::Derivatives::kNone, pass.get(), &error)) {
    return false;
  }
  const int count = samples.num_samples();
  const Index num_y = simulator.num_outputs();
  MatrixXd of_samples(num_y, Index{layout_.num_coefficients} * count);
  if (simulator.CoefficientJacobians(count,
                                     model_.SimulatorInputs(*pass).data(),
                                     samples.contexts.data(),
                                     of_samples.data()) < count) {
    return false;
  }
  const double scale = 1.0 / std::sqrt(static_cast<double>(count));
  for (int i = 0; i < layout_.num_coefficients; ++i) {
    double* const J = jacobians[num_blocks + i];
    if (J == nullptr) continue;
    for (Index s = 0; s < count; ++s) {
      Eigen::Map<VectorXd>(J + s * num_y, num_y) =
          scale * of_samples.col(s * layout_.num_coefficients + i);
    }
  }
  return true;
}

bool AddEquationToProblem(Equation* equation,
                          VectorXd* weights,
                          ceres::Problem* problem,
                          std::string* error) {
  DataSet samples;
  if (!EquationSamples(*equation, &samples, error)) return false;
  auto* cost = new EquationCostFunction(*equation, std::move(samples));
  const Model model = EquationModel(*equation);
  CHECK_EQ(weights->size(), model.num_weights());
  std::vector<double*> blocks = WeightBlocks(model.network(), weights->data());
  for (double& coefficient : equation->coefficients) {
    blocks.push_back(&coefficient);
  }
  problem->AddResidualBlock(cost, nullptr, blocks);
  return true;
}

}  // namespace invgrad
