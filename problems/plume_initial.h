// The inverse problem of a buoyant plume: the initial velocity of a box of
// fluid that carries a marker, from where the marker is at the end.
//
//   y = P(x): ds/dt + u . grad s = inflow,  s(0) = 0
//             du/dt + u . grad u = -grad p + (0, s),  div u = 0,  u(0) = x
//             y = s(20), for each of three inflows
//   L = 1/2 |y - y*|^2
//
// Discretization: a closed box of 32 x 40 cells of side 1, u on faces
//          (fields/velocity_grid.h), 20 steps of dt = 1, each of which
//            s <- MacCormack(s carried by u in the cells) + inflow
//            u <- Pi (semi-Lagrangian(u carried by u) + (0, s))
//          with (0, s) averaged to the faces and Pi the exact pressure
//          projection. Outside the box u is 0 and s that of the nearest cell.
//          x is not projected before the first step.
// Inflow:  1/3 a step in the cells whose centre lies less than 3 from
//          (x, y) = (12, 4), (13, 6), (14, 5).
// Shapes:  x: 3 (31 40 + 32 39) = 7464: for each inflow u_x, then u_y, each row
//          by row from the bottom; y: 3 (32 40) = 3840. J is never formed.
// Target:  three times the s(20) that starts at rest with the inflow at
//          (16, 5).
// Start:   x = 0.
// Facts:   no x reaches L = 0: the inflows stay where they are.
//          Published for gradient descent with step size 1e-3, in single
//          precision and with the projection to 1e-3: L = 298.286163,
//          291.454376, 276.057831 at the steps 0 to 2; 233.706482 at 9,
//          178.186951 at 29, 169.360931 at 49, 169.943680 at 79. From step 3
//          on the descent amplifies rounding, and no two machines agree.
// Source:  PBDL, chapter diffphys-code-ns.
#ifndef PROBLEMS_PLUME_INITIAL_H_
#define PROBLEMS_PLUME_INITIAL_H_

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/compare/problem.h"
#include "invgrad/field_simulator.h"
#include "problems/fields/velocity_grid.h"

namespace invgrad {

// s after num_steps steps from u = x, for each inflow.
// Cost: for an inflow and a step some 400 operations a cell and two cosine
//       transforms; a product costs about half as much. Linearize keeps 250
//       bytes a cell and step.
// Fails if y is not finite.
class PlumeSimulator final : public FieldSimulator {
 public:
  // The centre of an inflow, (x, y) in cells from the lower left corner.
  using Centre = std::array<double, 2>;

  PlumeSimulator(int rows,
                 int cols,
                 int num_steps,
                 const std::vector<Centre>& inflows);

  int num_inputs() const override {
    return static_cast<int>(inflows_.size()) * grid_.size();
  }
  int num_outputs() const override {
    return static_cast<int>(inflows_.size()) * grid_.num_cells();
  }
  bool Value(const double* x, const double* context, double* y) const override;
  std::unique_ptr<const JacobianOperator> Linearize(const double* x,
                                                    const double* context,
                                                    double* y) const override;

 private:
  struct Step;
  struct State {
    Eigen::VectorXd marker;
    Eigen::VectorXd velocity;
  };

  // The state after one step; appends what the products need, unless it is
  // null.
  State Advance(const State& state,
                const Eigen::VectorXd& inflow,
                std::vector<Step>* steps) const;
  // The final marker's change for a change of the initial velocity, and the
  // adjoint.
  Eigen::VectorXd Tangent(const std::vector<Step>& steps,
                          const Eigen::VectorXd& velocity) const;
  Eigen::VectorXd PullBack(const std::vector<Step>& steps,
                           const Eigen::VectorXd& marker_bar) const;

  VelocityGrid grid_;
  int num_steps_;
  std::vector<Eigen::VectorXd> inflows_;
};

struct PlumeInitial {
  void Describe(OptionSet* /*set*/) {}
  bool Create(PointProblem* problem, std::string* error) const;
};

}  // namespace invgrad

#endif  // PROBLEMS_PLUME_INITIAL_H_
