// An inviscid, incompressible flow in a periodic box, which carries a marker.
//
//   du/dt + u . grad u = -grad p,   div u = 0,   dm/dt + u . grad m = 0
//
// One step, in this order:
//   1. E_c = mean u_c^2, for each component c by itself
//   2. u <- MacCormack(u carried by u), each component at its own points
//   3. u <- P u, the exact pressure projection
//   4. u_c <- u_c sqrt(E_c / mean u_c^2), 0 if u_c = 0. It disturbs div u = 0
//      if the two factors differ.
//   5. m <- MacCormack(m carried by the new u)
//
// Shapes:  m: cells^2, row by row, y along a column; u: as velocity_grid.h, on
//          faces or in centres.
// Units:   u in lengths a time; courant = dt / dx.
// Derivative: with respect to the first u, by Tangent and PullBack, from what a
//          run has kept: some 360 bytes a cell and step.
// Cost:    a step: some 500 operations a cell and two Fourier transforms; a
//          product about half as much.
// Facts:   the energies of both components are conserved; the mean of m is not
//          exactly, because look-ups do not balance fluxes. u -> -u reverses
//          the flow, but for the errors of the advection.
// Fails:   values that are not finite give results that are not finite.
#ifndef PROBLEMS_NAVIER_STOKES_INVISCID_FLOW_H_
#define PROBLEMS_NAVIER_STOKES_INVISCID_FLOW_H_

#include <array>
#include <vector>

#include "Eigen/Core"
#include "problems/fields/advection.h"
#include "problems/fields/velocity_grid.h"

namespace invgrad {

class InviscidFlow {
 public:
  struct State {
    Eigen::VectorXd marker;
    Eigen::VectorXd velocity;
  };
  // What the derivative of one step needs.
  struct Step {
    // u_c <- scale u_c; before_slope and after_slope are the derivatives of
    // scale with respect to the mean of u_c^2 before 2 and, negative, after 3.
    struct Energy {
      double scale = 0.0;
      double before_slope = 0.0;
      double after_slope = 0.0;
    };
    std::array<AdvectedField, 2> velocity;
    std::array<Energy, 2> energy;
    Eigen::VectorXd before;     // u before the step
    Eigen::VectorXd projected;  // u after 3
    AdvectedField marker;
  };

  InviscidFlow(int cells, VelocityGrid::Place place, double courant);

  const VelocityGrid& grid() const { return grid_; }

  // The state after one step; appends to *steps unless it is null.
  State Advance(const State& state, std::vector<Step>* steps) const;

  // The change of the last m for a change of the first u, and its adjoint.
  Eigen::VectorXd Tangent(const std::vector<Step>& steps,
                          Eigen::VectorXd velocity) const;
  Eigen::VectorXd PullBack(const std::vector<Step>& steps,
                           Eigen::VectorXd marker_bar) const;

 private:
  VelocityGrid grid_;
  double courant_;
};

}  // namespace invgrad

#endif  // PROBLEMS_NAVIER_STOKES_INVISCID_FLOW_H_
