// The residual of a differential equation, as a simulator of the jets of a
// network.
//
//   y = w R(D u; c),   u = g + d N,   x = (N, D_1 N, .., D_{T-1} N)
//
// The equation R is a simulator of u and its stated derivatives alone, most
// often a functor (autodiff_simulator.h): its input is u, then the derivatives
// in the order of the words (derivative_set.h); of several functions u, v all
// values first, then all first words, and so on.
//
// Shapes:  x: |u| T;  input of R: |u| (1 + number of words);  y: that of R;
//          context: the jets of g and d, if the trial function has conditions,
//          the weight w of the sample, then c.
// Cost:    that of R, and two products of jets.
// Fails:   as R does.
#ifndef INVGRAD_CHAIN_EQUATION_SIMULATOR_H_
#define INVGRAD_CHAIN_EQUATION_SIMULATOR_H_

#include <memory>
#include <string>

#include "invgrad/chain/simulator.h"
#include "invgrad/chain/trial_function.h"

namespace invgrad {

class EquationSimulator final : public Simulator {
 public:
  // Sizes that do not fit are CHECKed.
  EquationSimulator(TrialFunction trial_function,
                    std::shared_ptr<const Simulator> equation);

  int num_inputs() const override;
  int num_outputs() const override { return equation_->num_outputs(); }
  int num_context() const override;
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override {
    return EvaluateBatch(1, x, context, y, jacobian) == 1;
  }
  int EvaluateBatch(int count,
                    const double* x,
                    const double* contexts,
                    double* y,
                    double* jacobians) const override;
  std::string WhyNoLanes() const override { return equation_->WhyNoLanes(); }
  bool has_weighted_hessian() const override {
    return equation_->has_weighted_hessian();
  }
  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override;

  const TrialFunction& trial_function() const { return trial_function_; }

 private:
  // The inputs of R and its contexts.
  Eigen::MatrixXd EquationInputs(int count,
                                 const double* x,
                                 const double* contexts) const;
  Eigen::MatrixXd EquationContexts(int count, const double* contexts) const;
  double Weight(const double* contexts, Eigen::Index sample) const;
  // x_bar = covectors of x for covectors of the inputs of R, of one sample: a
  // column each.
  void PullBackToNetwork(const double* context,
                         const Eigen::Ref<const Eigen::MatrixXd>& covectors,
                         Eigen::Ref<Eigen::MatrixXd> x_bar) const;

  TrialFunction trial_function_;
  std::shared_ptr<const Simulator> equation_;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_EQUATION_SIMULATOR_H_
