// The base class of simulators: the differentiable model between a network and
// a loss. Derive from it only if no other header serves: most simulators are
// functors (autodiff_simulator.h, time_stepping_simulator.h), matrices
// (linear_simulator.h) or fields (field_simulator.h).
//
//   y = P(x; c),   J = dP/dx
//
// Shapes:  x: num_inputs;  c: num_context, the data of a sample that is not
//          controlled (an initial state);  y: num_outputs;
//          J: num_outputs x num_inputs, row-major.
// Fails:   every function returns false if there is no finite value; its
//          outputs are then unspecified.
// Implementations are immutable, so that several threads may share one.
//
// Most simulators are functors on a scalar type T, differentiated by Jets: see
// autodiff_simulator.h, time_stepping_simulator.h, linear_simulator.h. A direct
// implementation needs the two sizes and Evaluate; a linear one can also apply
// the inverse powers of its J (InversePower). A simulator of fields, whose
// J is too large to form, derives from FieldSimulator (field_simulator.h).
#ifndef INVGRAD_SIMULATOR_H_
#define INVGRAD_SIMULATOR_H_

#include <algorithm>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/jacobian_operator.h"

namespace invgrad {

// Whether all `size` values are finite.
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

  // Whether J is small enough to be formed for each sample.
  virtual bool forms_jacobian() const { return true; }

  // Computes y; returns J, which refers to the simulator but not to x. Null if
  // there is no finite value. The default stores the J of Evaluate.
  virtual std::unique_ptr<const JacobianOperator> Linearize(
      const double* x, const double* context, double* y) const;

  // Writes a covector w (num_outputs) for the given y, usually dL/dy. Adjoint
  // returns false if this function does.
  using Covector = std::function<bool(const double* y, double* w)>;

  // Computes y and x_bar = J^T w(y) (num_inputs). The default forms J; override
  // it if one forward and one backward pass are cheaper.
  virtual bool Adjoint(const double* x,
                       const double* context,
                       const Covector& covector,
                       double* y,
                       double* x_bar) const;

  // Evaluate and Adjoint for `count` samples: one column a sample, J one after
  // the other. Return the number of samples before the first that fails. The
  // defaults call the functions above; override both if several samples at once
  // are faster, with the same bits.
  virtual int EvaluateBatch(int count,
                            const double* x,
                            const double* contexts,
                            double* y,
                            double* jacobians) const;
  // May be called twice for a sample.
  using BatchCovector =
      std::function<bool(int sample, const double* y, double* w)>;
  virtual int AdjointBatch(int count,
                           const double* x,
                           const double* contexts,
                           const BatchCovector& covector,
                           double* x_bar) const;
  // Why the functions for batches compute one sample at a time; empty if they
  // compute several at once.
  virtual std::string WhyNoLanes() const {
    return "the simulator is not a functor";
  }

  // Computes H = sum_i w_i d2P_i/dx2, num_inputs x num_inputs, symmetric.
  // Optional: only Newton's method needs it. Override both functions or
  //           neither.
  virtual bool has_weighted_hessian() const { return false; }
  virtual bool WeightedHessian(const double* x,
                               const double* context,
                               const double* w,
                               double* hessian) const;

  // Computes dP/dc, num_outputs x num_context, row-major. Optional: only a
  // SimulatorCost with the context as a parameter block (cost.h) needs it.
  // Override both functions or neither.
  virtual bool has_context_jacobian() const { return false; }
  virtual bool ContextJacobian(const double* x,
                               const double* context,
                               double* jacobian) const;

  // Whether J is the same for every x and context, and the simulator applies
  // its inverse powers: pull-backs then decompose nothing. Optional; override
  // both functions or neither.
  virtual bool is_linear() const { return false; }
  // Computes d_x = V s^-kappa U^T d_y over s > tau s_max, where J = U s V^T;
  // zero if J is.
  virtual void InversePower(double kappa,
                            double tau,
                            const double* d_y,
                            double* d_x) const;

  // Describes where one of the functions above failed at (x, context), for a
  // message; may be empty. Evaluates once more.
  virtual std::string DescribeFailure(const double* /*x*/,
                                      const double* /*context*/) const {
    return "";
  }

 protected:
  // x_bar = J^T w. Returns false if it is not finite.
  bool PullBack(const double* jacobian, const double* w, double* x_bar) const;
};

// Returns false, with advice in *error, if the simulator has no
// WeightedHessian.
bool CheckHasHessian(const Simulator& simulator, std::string* error);

// The message for a failed call: "the simulator has no finite value", or that
// its derivative has none, followed by ": " and the place if known.
std::string SimulatorFailure(const Simulator& simulator,
                             const double* x,
                             const double* context);

// y = x: a chain without physics.
class IdentitySimulator final : public Simulator {
 public:
  explicit IdentitySimulator(int size) : size_(size) {}
  int num_inputs() const override { return size_; }
  int num_outputs() const override { return size_; }
  bool Evaluate(const double* x,
                const double* /*context*/,
                double* y,
                double* jacobian) const override {
    std::copy_n(x, size_, y);
    if (jacobian != nullptr) {
      Eigen::Map<Eigen::MatrixXd>(jacobian, size_, size_).setIdentity();
    }
    return AllFinite(y, size_);
  }
  bool Adjoint(const double* x,
               const double* /*context*/,
               const Covector& covector,
               double* y,
               double* x_bar) const override {
    return Evaluate(x, nullptr, y, nullptr) && covector(y, x_bar) &&
           AllFinite(x_bar, size_);
  }
  bool has_weighted_hessian() const override { return true; }
  bool WeightedHessian(const double* /*x*/,
                       const double* /*context*/,
                       const double* /*w*/,
                       double* hessian) const override {
    Eigen::Map<Eigen::MatrixXd>(hessian, size_, size_).setZero();
    return true;
  }
  bool is_linear() const override { return true; }
  void InversePower(double /*kappa*/,
                    double tau,
                    const double* d_y,
                    double* d_x) const override {
    if (tau < 1.0) {
      std::copy_n(d_y, size_, d_x);
    } else {
      std::fill_n(d_x, size_, 0.0);
    }
  }

 private:
  int size_;
};

}  // namespace invgrad

#endif  // INVGRAD_SIMULATOR_H_
