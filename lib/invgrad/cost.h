// Simulators, networks and models as cost functions of Ceres. Use them to put
// physics or a network into a ceres::Problem of your own, beside other residual
// blocks; CostFunctionSimulator makes a simulator behind a network of a cost
// function that you have.
//
//   SimulatorCost        r = P(x; c) - y*             blocks: x, or x and c
//   NetworkCost          r = f(a; theta) - x*         blocks: theta
//   TrainedNetworkCost   r = f(a; theta) - x*         blocks: a
//   ModelCost            r_s = k (P(f(a_s; theta); c_s) - y*_s)   blocks: theta
//   CostFunctionSimulator   y = P(x; c) = r(x, c)
//
//   problem.AddResidualBlock(new SimulatorCost(simulator, target), nullptr, x);
//   problem.AddResidualBlock(new NetworkCost(network, input, target), nullptr,
//                            WeightBlocks(*network, weights.data()));
//
// Jacobians are exact: of the simulator's Evaluate and of the network's backward
// pass, not by Jets over all weights. The functors themselves remain functors:
// for a small network inside a functor of your own see NetworkFunctor
// (dense_network.h).
//
// The weights theta are the parameter blocks of Network::WeightBlocks, in the
// order of the weight vector. Those of a DenseNetwork are the neurons (incoming
// weights and bias), so that blocks are small, as UpdateCallback wants them, and
// a neuron or a layer can be held constant.
//
// Shapes:  x: num_inputs and y: num_outputs of the simulator; a: num_inputs and
//          x: num_outputs of the network; sizes that do not fit are CHECKed.
// Cost:    the dense Jacobian of the block: of ModelCost |y| B x n. Blocks of
//          few samples let Ceres' threads share them; blocks of many samples
//          evaluate the network on all of them at once.
// Fails:   Evaluate returns false where simulator or network have no finite
//          value.
#ifndef INVGRAD_COST_H_
#define INVGRAD_COST_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/problem.h"
#include "invgrad/data.h"
#include "invgrad/model.h"
#include "invgrad/network.h"
#include "invgrad/second_order_cost_function.h"
#include "invgrad/simulator.h"

namespace invgrad {

class SimulatorCost final : public ceres::CostFunction {
 public:
  // `context`: c, constant. Without it, the context of a simulator that has one
  // is the second parameter block, such as an unknown mass or initial state: only
  // for a simulator with ContextJacobian (CHECKed), which functors have whose
  // context has a scalar type of its own, and all that step a state through time.
  // `residual`: a cost function with one parameter block, y, in place of y - y*;
  // ceres::NormalPrior(A, target) is A (y - y*).
  SimulatorCost(std::shared_ptr<const Simulator> simulator,
                const Eigen::VectorXd& target,
                Eigen::VectorXd context = {});
  SimulatorCost(std::shared_ptr<const Simulator> simulator,
                std::shared_ptr<const ceres::CostFunction> residual,
                Eigen::VectorXd context = {});

  bool Evaluate(const double* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  SimulatorCost(std::shared_ptr<const Simulator> simulator,
                std::shared_ptr<const ceres::CostFunction> residual,
                Eigen::VectorXd target,
                Eigen::VectorXd context);

  const std::shared_ptr<const Simulator> simulator_;
  const std::shared_ptr<const ceres::CostFunction> residual_;  // null: y - y*
  const Eigen::VectorXd target_;
  const Eigen::VectorXd context_;
};

// The samples of one residual block, with the factor k = sqrt(2 c scale) for a
// loss c |y - y*|^2, so that 1/2 |r|^2 is the model's cost. CHECKs that the loss
// is a squared norm (Loss::SquaredNormFactor).
class ModelCost final : public SecondOrderCostFunction {
 public:
  // `samples` may be a piece of a batch (DataSet::Piece): the costs of all
  // pieces then add up to that of the batch.
  ModelCost(const Model& model, DataSet samples);

  bool Evaluate(const double* const* parameters,
                double* residuals,
                double** jacobians) const override;
  // By one tangent-of-backward pass for each unit, over all samples; only for a
  // model with factors.
  bool WeightedHessian(const double* const* parameters,
                       const double* w,
                       double* hessian) const override;

 private:
  Eigen::VectorXd Weights(const double* const* parameters) const;

  const Model model_;
  const DataSet samples_;
  const double scale_;  // k
};

class NetworkCost final : public ceres::CostFunction {
 public:
  NetworkCost(const std::shared_ptr<const Network>& network,
              const Eigen::VectorXd& input,
              const Eigen::VectorXd& target);
  bool Evaluate(const double* const* parameters,
                double* residuals,
                double** jacobians) const override {
    return of_model_.Evaluate(parameters, residuals, jacobians);
  }

 private:
  ModelCost of_model_;
};

// A network with constant weights, as a residual of its input: a learned factor.
// Only for networks with derivatives by their input (InputJacobianOf): those of
// DenseNetwork and of libtorch (CHECKed).
class TrainedNetworkCost final : public ceres::CostFunction {
 public:
  TrainedNetworkCost(std::shared_ptr<const Network> network,
                     Eigen::VectorXd weights,
                     Eigen::VectorXd target);
  bool Evaluate(const double* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  const std::shared_ptr<const Network> network_;
  const Eigen::VectorXd weights_;
  const Eigen::VectorXd target_;
};

// A cost function of Ceres as a simulator: x is its parameter blocks, one after
// the other, and the context its last num_context_blocks blocks; y its
// residuals. Several threads may evaluate it at once.
class CostFunctionSimulator final : public Simulator {
 public:
  explicit CostFunctionSimulator(
      std::shared_ptr<const ceres::CostFunction> cost_function,
      int num_context_blocks = 0);

  int num_inputs() const override { return num_inputs_; }
  int num_outputs() const override { return cost_function_->num_residuals(); }
  int num_context() const override { return num_context_; }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override;
  bool has_context_jacobian() const override { return num_context_ > 0; }
  bool ContextJacobian(const double* x,
                       const double* context,
                       double* jacobian) const override;

 private:
  // Computes y and, unless null, the Jacobians by all inputs and by the context.
  bool EvaluateBlocks(const double* x,
                      const double* context,
                      double* y,
                      double* input_jacobian,
                      double* context_jacobian) const;

  const std::shared_ptr<const ceres::CostFunction> cost_function_;
  int num_input_blocks_ = 0;
  int num_inputs_ = 0;
  int num_context_ = 0;
};

// The parameter blocks of `weights` (n).
std::vector<double*> WeightBlocks(const Network& network, double* weights);

struct ModelBlockOptions {
  int samples_per_block = 0;  // 0: all samples in one residual block
  // Of every residual block; owned as the problem's options say. With one
  // sample a block it is a robust loss of the sample.
  ceres::LossFunction* loss_function = nullptr;
};

// Adds the model's cost over `data` to the problem, and returns the residual
// blocks. `weights` (n) must outlive the problem.
std::vector<ceres::ResidualBlockId> AddModelToProblem(
    const Model& model,
    const DataSet& data,
    double* weights,
    ceres::Problem* problem,
    const ModelBlockOptions& options = {});

}  // namespace invgrad

#endif  // INVGRAD_COST_H_
