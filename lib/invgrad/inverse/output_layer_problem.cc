#include "invgrad/inverse/output_layer_problem.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include "invgrad/chain/sample_error.h"
#include "invgrad/internal/layered_jacobian.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/network_layers.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

bool SetLinearProblem(const Model& model,
                      const VectorXd& weights,
                      const DataSet& samples,
                      OutputLayerProblem* problem,
                      std::string* error) {
  const std::unique_ptr<Network::Pass> pass = model.network().NewPass();
  if (!model.Forward(
          weights, samples, Network::Derivatives::kFirst, pass.get(), error)) {
    return false;
  }
  const auto x = model.SimulatorInputs(*pass);
  SetProblemInX(model.network(),
                weights,
                *pass,
                samples.solutions - x,
                VectorXd(),
                problem);
  return true;
}

}  // namespace

bool IsSolvedInX(const Model& model) {
  return model.simulator().is_linear() && model.num_columns() == 1;
}

bool SetLeastSquaresSolutions(const Model& model,
                              DataSet* samples,
                              std::string* error) {
  CHECK(IsSolvedInX(model));
  const Simulator& P = model.simulator();
  const double truncation = std::max(P.num_inputs(), P.num_outputs()) *
                            std::numeric_limits<double>::epsilon();
  const VectorXd zero = VectorXd::Zero(P.num_inputs());
  VectorXd y(P.num_outputs());
  samples->solutions.resize(P.num_inputs(), samples->num_samples());
  for (int s = 0; s < samples->num_samples(); ++s) {
    const auto context = samples->Context(s);
    if (!P.Evaluate(zero.data(), context.data(), y.data(), nullptr)) {
      return SampleError(
          *samples, s, SimulatorFailure(P, zero.data(), context.data()), error);
    }
    y = samples->targets.col(s) - y;
    P.InversePower(1.0, truncation, y.data(), samples->solutions.col(s).data());
  }
  return true;
}

void SetProblemInX(const Network& network,
                   const VectorXd& weights,
                   const Network::Pass& pass,
                   const MatrixXd& d_x,
                   const VectorXd& scales,
                   OutputLayerProblem* problem) {
  const Index fan_out = OutputLayerOf(network).cols();
  CHECK_GT(fan_out, 0);
  const Index num_positions = network.num_outputs() / fan_out;
  problem->H = FeaturesOf(network, weights, pass);
  problem->D.resize(fan_out, d_x.size() / fan_out);
  CHECK_EQ(problem->H.cols(), problem->D.cols());
  if (num_positions == 1) {
    problem->D = d_x.reshaped(fan_out, problem->D.cols());
  } else {
    for (Index k = 0; k < problem->D.cols(); k += num_positions) {
      problem->D.middleCols(k, num_positions) =
          d_x.reshaped()
              .segment(k * fan_out, num_positions * fan_out)
              .reshaped(num_positions, fan_out)
              .transpose();
    }
  }
  if (scales.size() == 0) return;
  CHECK_EQ(scales.size(), d_x.cols());
  const Index of_sample = problem->H.cols() / d_x.cols();
  for (Index s = 0; s < d_x.cols(); ++s) {
    const double root = std::sqrt(scales[s]);
    problem->H.middleCols(s * of_sample, of_sample) *= root;
    problem->D.middleCols(s * of_sample, of_sample) *= root;
  }
}

bool LinearizeLossInOutputLayer(const Model& model,
                                const VectorXd& weights,
                                const DataSet& samples,
                                OutputLayerProblem* problem,
                                std::string* error) {
  const std::optional<double> factor = model.loss().SquaredNormFactor();
  CHECK(factor.has_value());
  if (IsSolvedInX(model)) {
    return SetLinearProblem(model, weights, samples, problem, error);
  }
  CHECK(model.has_factors());
  Linearization at_weights;
  if (!model.Linearize(weights,
                       samples,
                       LinearizationParts::Jacobian(),
                       &at_weights,
                       error)) {
    return false;
  }
  MatrixXd J_c;
  ColumnBlocksOf(*at_weights.jacobian).back()->ToDense(&J_c);
  problem->H = J_c.transpose();
  // g = 2 factor scale (y - y*).
  problem->D = at_weights.loss_gradient.transpose() /
               (-2.0 * *factor * model.BatchScale(samples.batch_size()));
  return true;
}

}  // namespace invgrad
