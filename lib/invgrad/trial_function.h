// A trial function: a network with features of the point as inputs, whose
// outputs satisfy conditions exactly.
//
//   u(a; theta) = g(a) + d(a) N(phi(a); theta)
//
// Where d is zero, u = g for any weights: initial and boundary values without a
// term in the loss [1]. A d with a double zero fixes the first derivative, too.
// Features phi make u periodic, even or odd, or resolve many scales
// (features.h).
//
// Shapes:  a: d coordinates;  phi: features.size;  u, g, d, N: num_functions;
//          all as jets of T channels (derivative_set.h), d entry by entry.
//          In a DataSet, inputs are the jets of phi, and contexts begin with
//          the jets of g and d (ConditionSize() rows).
// Fails:   where a jet is not finite at a point, with a message that names the
//          point and the derivative.
//
// [1] Lagaris, Likas, Fotiadis. Artificial neural networks for solving ordinary
//     and partial differential equations. IEEE Trans. Neural Networks 9 (1998).
#ifndef INVGRAD_TRIAL_FUNCTION_H_
#define INVGRAD_TRIAL_FUNCTION_H_

#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/dense_network.h"
#include "invgrad/derivative_set.h"
#include "invgrad/equations/features.h"
#include "invgrad/equations/input_jet.h"

namespace invgrad {

struct TrialFunction {
  std::shared_ptr<const DerivativeSet> derivatives;
  int num_functions = 1;
  Features features;  // none: the coordinates
  // Both null: u = N.
  InputFunction boundary_values;  // g
  InputFunction distance;         // d

  bool has_conditions() const { return boundary_values != nullptr; }
  int NumInputs() const;      // |phi|
  int ConditionSize() const;  // 2 num_functions T, or 0

  // The jets of phi at the points (d x N): |phi| T x N.
  bool Inputs(const Eigen::MatrixXd& points,
              Eigen::MatrixXd* inputs,
              std::string* error) const;
  // The jets of g, then those of d: ConditionSize() x N.
  bool Conditions(const Eigen::MatrixXd& points,
                  Eigen::MatrixXd* conditions,
                  std::string* error) const;

  // The jets of u for those of N: num_functions T x N. Only the first
  // ConditionSize() rows of `contexts` are read.
  Eigen::MatrixXd Values(const Eigen::MatrixXd& network_jets,
                         const Eigen::MatrixXd& contexts) const;
};

// u at a point, with its derivatives in what the point depends on.
void EvaluateTrialFunction(const TrialFunction& trial,
                           const DenseNetwork& network,
                           const Eigen::VectorXd& weights,
                           const InputJet* point,
                           InputJet* u);

}  // namespace invgrad

#endif  // INVGRAD_TRIAL_FUNCTION_H_
