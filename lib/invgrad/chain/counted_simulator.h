// A simulator that counts the calls that a method makes.
//
//   calls = values y + products J v + products J^T w, each of a sample
//
// Adjoint is a value and a J^T w. A Jacobian that is formed counts as the
// min(|x|, |y|) products that give it, also where a functor computes it at once:
// Evaluate with a Jacobian is a value and these, and so is Linearize of a
// simulator that forms its Jacobian; otherwise Linearize is a value, and each
// product counts. InversePower, WeightedHessian and ContextJacobian are one. With
// feedback, a sample's roll-out and its evaluation are one value.
//
// Cost:    one function call more for each, or for each batch.
// Several threads may share it: the count is atomic.
#ifndef INVGRAD_CHAIN_COUNTED_SIMULATOR_H_
#define INVGRAD_CHAIN_COUNTED_SIMULATOR_H_

#include <atomic>
#include <memory>
#include <string>

#include "invgrad/model.h"
#include "invgrad/simulator.h"

namespace invgrad {

class CountedSimulator final : public Simulator {
 public:
  explicit CountedSimulator(std::shared_ptr<const Simulator> inner);

  long num_calls() const { return *num_calls_; }
  const Simulator& inner() const { return *inner_; }

  int num_inputs() const override { return inner_->num_inputs(); }
  int num_outputs() const override { return inner_->num_outputs(); }
  int num_context() const override { return inner_->num_context(); }
  bool forms_jacobian() const override { return inner_->forms_jacobian(); }
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
  int EvaluateBatch(int count,
                    const double* x,
                    const double* contexts,
                    double* y,
                    double* jacobians) const override;
  int AdjointBatch(int count,
                   const double* x,
                   const double* contexts,
                   const BatchCovector& covector,
                   double* x_bar) const override;
  std::string WhyNoLanes() const override { return inner_->WhyNoLanes(); }
  bool has_weighted_hessian() const override {
    return inner_->has_weighted_hessian();
  }
  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override;
  bool has_context_jacobian() const override {
    return inner_->has_context_jacobian();
  }
  bool ContextJacobian(const double* x,
                       const double* context,
                       double* jacobian) const override;
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
  // Of a value, with the products for a Jacobian if it is formed.
  int NumCalls(bool forms_jacobian) const;

  std::shared_ptr<const Simulator> inner_;
  std::shared_ptr<std::atomic<long>> num_calls_;  // shared with Jacobians
};

// The same chain through the counted simulator of the model.
Model WithSimulator(const Model& model,
                    std::shared_ptr<const CountedSimulator> simulator);

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_COUNTED_SIMULATOR_H_
