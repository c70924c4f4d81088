// The least-squares problem of the best output layer of a network (chain/
// network.h), for a change Z of it.
//
//   min_Z |Z^T H - D|^2
//
//   in x:  |x_s + Z^T h_s - x~_s|^2 over all samples s and positions:
//          H: the features,  D = X~ - X,  Z: fan_in x fan_out
//   in y:  |y + J_c vec(Z) - y*|^2:  H = J_c^T,  D = (y* - y)^T
//
// J_c is the Jacobian of the simulator's outputs in the layer's weights. For
// linear simulators y = P x + b the best layer of |P X + b - Y*|^2 is the best
// layer in x for the targets P^+ (Y* - b): their normal equations are P^T P (C^T
// H - P^+ (Y* - b)) H^T = 0. In x a problem has fan_in unknowns in place of
// fan_in fan_out.
//
// Shapes:  H: fan_in x m, D: fan_out x m;  or H: fan_in fan_out x m, D: 1 x m,
//          for a vec(Z) column by column.
#ifndef INVGRAD_INVERSE_OUTPUT_LAYER_PROBLEM_H_
#define INVGRAD_INVERSE_OUTPUT_LAYER_PROBLEM_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/model.h"

namespace invgrad {

struct OutputLayerProblem {
  Eigen::MatrixXd H;
  Eigen::MatrixXd D;
};

// Whether the best output layer of the model's loss is a problem in x.
bool IsSolvedInX(const Model& model);

// The problem in x, for the changes d_x = x~ - x (|x| x B) of the outputs of a
// pass with derivatives, with the factor `scales` (B) for each sample's squares;
// empty: one.
void SetProblemInX(const Network& network,
                   const Eigen::VectorXd& weights,
                   const Network::Pass& pass,
                   const Eigen::MatrixXd& d_x,
                   const Eigen::VectorXd& scales,
                   OutputLayerProblem* problem);

// Replaces the solutions x* of the samples by P^+ (y* - b). Only if IsSolvedInX
// (CHECKed). Returns false, with *error, if P has no finite value.
bool SetLeastSquaresSolutions(const Model& model,
                              DataSet* samples,
                              std::string* error);

// The problem of the model's loss, a squared norm (CHECKed): in x, for samples
// of SetLeastSquaresSolutions, if IsSolvedInX, otherwise in y. Returns false,
// with *error, if a value is not finite.
bool LinearizeLossInOutputLayer(const Model& model,
                                const Eigen::VectorXd& weights,
                                const DataSet& samples,
                                OutputLayerProblem* problem,
                                std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_INVERSE_OUTPUT_LAYER_PROBLEM_H_
