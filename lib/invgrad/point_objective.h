// A simulator and a loss without a network, at a point: the unknowns are x.
//
//   L(x) = L(P(x), y*),   J = dP/dx,   g = dL/dy
//   d2L/dx2 = J^T H_L J + sum_i g_i d2P_i/dx2
//
// It is a Model with a WeightsNetwork (chain/weights_network.h), one sample, and a
// current point.
//
// Shapes:  x: n = |x|;  y: m = |y|.
// Units:   g and J are derivatives for y, not for a residual: L = c |y - y*|^2
//          has g = 2 c (y - y*) and H_L = 2 c I.
// Cost:    the gradient alone: the simulator's adjoint, without J. Otherwise
//          one simulator evaluation with Jacobian, or one Linearize if the
//          simulator does not form it; the Hessian adds one.
// Fails:   Linearize and Cost return false where the model does, and if J and the
//          Hessian, which are dense, do not fit into memory.
#ifndef INVGRAD_POINT_OBJECTIVE_H_
#define INVGRAD_POINT_OBJECTIVE_H_

#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/internal/objective.h"
#include "invgrad/model.h"

namespace invgrad {

class PointObjective final : public Objective {
 public:
  // Sizes must fit, and the simulator must not need a context (CHECKed).
  PointObjective(std::shared_ptr<const Simulator> simulator,
                 std::shared_ptr<const Loss> loss,
                 Eigen::VectorXd target,
                 Eigen::VectorXd start);

  int num_parameters() const override { return model_.num_weights(); }
  bool Linearize(const LinearizationParts& parts,
                 Linearization* linearization,
                 std::string* error) const override;
  bool Cost(double* cost, std::string* error) const override {
    return model_.Cost(x_, data_, cost, error);
  }
  Eigen::VectorXd State() const override { return x_; }
  void SetState(const Eigen::VectorXd& state) override;
  bool Plus(const Eigen::VectorXd& step) override;

  // y = P(x); empty if the simulator fails.
  Eigen::VectorXd Outputs() const;

  // The network's outputs are its weights, x.
  const Model& model() const { return model_; }
  // One sample.
  const DataSet& data() const { return data_; }
  Eigen::VectorXd target() const { return data_.targets.col(0); }

 private:
  Model model_;
  DataSet data_;
  Eigen::VectorXd x_;
};

}  // namespace invgrad

#endif  // INVGRAD_POINT_OBJECTIVE_H_
