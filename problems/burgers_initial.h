// The inverse problem of Burgers' equation: from the state at t = 1/2, with its
// shock, to the initial state.
//
//   y = P(x): du/dt + u du/dx = nu d2u/dx2, periodic on [-1, 1], u(0) = x,
//             y = u(1/2)
//   L = 1/128 |y - y*|^2
//
// Discretization: 128 cells, dx = 1/64; 16 steps of dt = 1/32, each of which
//          diffuses explicitly by nu dt / dx^2, then carries u by itself,
//          semi-Lagrangian (fields/advection.h); nu = 0.01 / (128 pi).
// Shapes:  x, y: 128. J is applied, and formed only where a rule needs it.
// Data:    target=published: the 128 numbers that the source lists, to six
//          digits; they are odd. What made them is not published; this
//          simulator does not give them from -sin(pi x), in cell centres, after
//          any number of steps. target=simulated: P(-sin(pi x)).
// Start:   x = 0.
// Facts:   simulated: -sin(pi x) minimizes L, with L = 0. J is nearly singular
//          where characteristics have met. The derivative of L jumps where a
//          look-up meets a cell centre.
//          Published for gradient descent with step size 5, at the steps
//          0 to 4: L = 0.382915, 0.326882, 0.281032, 0.242804, 0.210666; at
//          10, 25, 45: 0.096224, 0.020334, 0.003263.
// Source:  PBDL, chapter diffphys-code-burgers.
#ifndef PROBLEMS_BURGERS_INITIAL_H_
#define PROBLEMS_BURGERS_INITIAL_H_

#include <memory>
#include <string>

#include "invgrad/compare/problem.h"
#include "invgrad/field_simulator.h"

namespace invgrad {

// `num_steps` steps of
//   v_i = u_i + diffusion (u_{i-1} - 2 u_i + u_{i+1}),   diffusion = nu dt / dx^2
//   u <- v carried by courant v,                         courant = dt / dx
// Cost: a product J v or J^T w as much as y. Fails if y is not finite.
class BurgersSimulator final : public FieldSimulator {
 public:
  BurgersSimulator(int num_cells,
                   int num_steps,
                   double diffusion,
                   double courant);

  int num_inputs() const override { return num_cells_; }
  int num_outputs() const override { return num_cells_; }
  bool Value(const double* x, const double* context, double* y) const override;
  std::unique_ptr<const JacobianOperator> Linearize(const double* x,
                                                    const double* context,
                                                    double* y) const override;

 private:
  int num_cells_;
  int num_steps_;
  double diffusion_;
  double courant_;
};

struct BurgersInitial {
  std::string target = "published";
  void Describe(OptionSet* set);
  bool Create(PointProblem* problem, std::string* error) const;
};

}  // namespace invgrad

#endif  // PROBLEMS_BURGERS_INITIAL_H_
