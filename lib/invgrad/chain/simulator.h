// A simulator is the physics between a network and a loss.
//
//   y = P(x; c),   J = dP/dx
//
// Shapes:  x: num_inputs;  c: num_context, what belongs to a sample and is not
//          controlled (an initial state);  y: num_outputs;
//          J: num_outputs x num_inputs, row-major.
// Fails:   every function returns false where the physics has no finite value;
//          its outputs are then unspecified.
// Implementations are immutable, so that several threads may share one.
//
// A simulator is written as functors on a scalar type T and differentiated by
// Jets: see autodiff_simulator.h, time_stepping_simulator.h,
// linear_simulator.h.
#ifndef INVGRAD_CHAIN_SIMULATOR_H_
#define INVGRAD_CHAIN_SIMULATOR_H_

#include <cstddef>
#include <functional>
#include <string>

namespace invgrad {

// Whether none of `size` values is infinite or NaN.
bool AllFinite(const double* values, std::ptrdiff_t size);

// "the state is not finite after time step 17 of 96", of the step t = 16.
std::string AtTimeStep(const std::string& what,
                       std::ptrdiff_t t,
                       std::ptrdiff_t num_steps);

class Simulator {
 public:
  virtual ~Simulator() = default;

  virtual int num_inputs() const = 0;
  virtual int num_outputs() const = 0;
  virtual int num_context() const { return 0; }

  // Computes y and, unless it is null, J. `context` may be null if
  // num_context() is 0.
  virtual bool Evaluate(const double* x,
                        const double* context,
                        double* y,
                        double* jacobian) const = 0;

  // Given y, writes a covector w (num_outputs), usually dL/dy. If it returns
  // false, so does PullBack.
  using Covector = std::function<bool(const double* y, double* w)>;

  // Computes y and x_bar = J^T w(y) (num_inputs), by one forward and one
  // backward pass where that is cheaper than J. By default through J.
  virtual bool PullBack(const double* x,
                        const double* context,
                        const Covector& covector,
                        double* y,
                        double* x_bar) const;

  // Computes H = sum_i w_i d2P_i/dx2, num_inputs x num_inputs, symmetric.
  virtual bool WeightedHessian(const double* x,
                               const double* context,
                               const double* w,
                               double* hessian) const = 0;

  // After one of the functions above has failed: where, for a message; empty if
  // there is nothing to say but that it failed. Evaluates once more.
  virtual std::string DescribeFailure(const double* /*x*/,
                                      const double* /*context*/) const {
    return "";
  }
};

// What a message says where it has failed: "the simulator has no finite value"
// and, if known, ": " and where.
std::string SimulatorFailure(const Simulator& simulator,
                             const double* x,
                             const double* context);

// y = x: the chain without physics.
class IdentitySimulator final : public Simulator {
 public:
  explicit IdentitySimulator(int size) : size_(size) {}
  int num_inputs() const override { return size_; }
  int num_outputs() const override { return size_; }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override;
  bool PullBack(const double* x,
                const double* context,
                const Covector& covector,
                double* y,
                double* x_bar) const override;
  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override;

 private:
  int size_;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_SIMULATOR_H_
