// The loss of a model over a data set as a cost function of Ceres.
//
//   as a cost function   r = sqrt(2 c scale) (y(theta) - y*), so that
//                        1/2 |r|^2 = scale sum_s c |y_s - y*_s|^2 = L
//   as a function        L(theta) and its gradient, by one backward pass
//
// The weights are the parameter blocks of Network::WeightBlocks, in the order of
// the weight vector. Those of a DenseNetwork are the neurons (incoming weights
// and bias): blocks are small, and a neuron or a layer can be held constant.
// Cost:    the cost function forms J (m x n); the function L(theta) does not.
// Fails:   Evaluate returns false where the model does.
#ifndef INVGRAD_CERES_MODEL_COST_H_
#define INVGRAD_CERES_MODEL_COST_H_

#include <string>
#include <vector>

#include "ceres/first_order_function.h"
#include "ceres/problem.h"
#include "invgrad/model.h"
#include "invgrad/second_order_cost_function.h"

namespace invgrad {

// CHECKs that the loss is a squared norm (Loss::SquaredNormFactor).
class ModelCostFunction final : public SecondOrderCostFunction {
 public:
  // Model and data must outlive the function.
  ModelCostFunction(const Model* model, const DataSet* data);
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;
  // By one tangent-of-backward pass for each unit, over all samples; only for
  // a model with factors.
  bool WeightedHessian(const double* const* parameters,
                       const double* w,
                       double* hessian) const override;

 private:
  Eigen::VectorXd Weights(const double* const* parameters) const;

  const Model* model_;
  const DataSet* data_;
};

class ModelFunction final : public ceres::FirstOrderFunction {
 public:
  ModelFunction(const Model* model, const DataSet* data);
  bool Evaluate(const double* parameters,
                double* cost,
                double* gradient) const override;
  int NumParameters() const override { return model_->num_weights(); }

 private:
  const Model* model_;
  const DataSet* data_;
};

// The parameter blocks of `weights` (n).
std::vector<double*> WeightBlocks(const Network& network, double* weights);

// Adds the model's cost over `data` to the problem; `weights` must outlive it.
void AddModelToProblem(const Model* model,
                       const DataSet* data,
                       Eigen::VectorXd* weights,
                       ceres::Problem* problem);

}  // namespace invgrad

#endif  // INVGRAD_CERES_MODEL_COST_H_
