// A simulator that counts the calls that a method makes.
//
//   calls = values y + products J v + products J^T w
//
// Linearize is the value that it computes; Adjoint is a value and a J^T w;
// Evaluate with a Jacobian is a value and the min(|x|, |y|) products that a
// simulator of fields needs for it; InversePower and
// WeightedHessian are one.
//
// Cost:    one function call more for each.
// Several threads may share it: the count is atomic.
#ifndef BIN_SUPPORT_COUNTED_SIMULATOR_H_
#define BIN_SUPPORT_COUNTED_SIMULATOR_H_

#include <atomic>
#include <memory>
#include <string>

#include "invgrad/simulator.h"

namespace invgrad {

// `inner` must not form its Jacobian (CHECKed).
class CountedSimulator final : public Simulator {
 public:
  explicit CountedSimulator(std::shared_ptr<const Simulator> inner);

  long num_calls() const { return *num_calls_; }

  int num_inputs() const override { return inner_->num_inputs(); }
  int num_outputs() const override { return inner_->num_outputs(); }
  int num_context() const override { return inner_->num_context(); }
  bool forms_jacobian() const override { return false; }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override;
  std::unique_ptr<const JacobianOperator> Linearize(const double* x,
                                                    const double* context,
                                                    double* y) const override;
  bool Adjoint(const double* x,
               const double* context,
               const Covector& covector,
               double* y,
               double* x_bar) const override;
  bool has_weighted_hessian() const override {
    return inner_->has_weighted_hessian();
  }
  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override;
  bool is_linear() const override { return inner_->is_linear(); }
  void InversePower(double kappa,
                    double tau,
                    const double* d_y,
                    double* d_x) const override;
  std::string DescribeFailure(const double* x,
                              const double* context) const override {
    return inner_->DescribeFailure(x, context);
  }

 private:
  std::shared_ptr<const Simulator> inner_;
  std::shared_ptr<std::atomic<long>> num_calls_;  // shared with Jacobians
};

}  // namespace invgrad

#endif  // BIN_SUPPORT_COUNTED_SIMULATOR_H_
