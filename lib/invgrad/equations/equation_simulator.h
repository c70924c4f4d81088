// The terms of a differential equation's loss, as a simulator of the jets of a
// network.
//
//   y = w R_k(D u, p; c),   u = g + d N,   x = (N, D_1 N, .., D_{T-1} N)
//
// k is the term that a sample belongs to: the equation inside, a condition at
// the boundary, a measurement. p are the coefficients of the equation, the same
// at all samples; they are parameters of equation_cost.h, and constants
// elsewhere.
//
// A residual R_k is a simulator of u and its stated derivatives alone, most
// often a functor (autodiff_simulator.h). Its input is u, then the derivatives
// in the order of the words (derivative_set.h); of several functions u, v all
// values first, then all first words, and so on; then p.
//
// Shapes:  x: |u| T;  input of R_k: |u| (1 + number of words) + |p|;
//          y: the outputs of the largest R_k, the others followed by zeros;
//          context: EquationContext.
// Cost:    that of R_k, and two products of jets.
// Fails:   as R_k does; the message names the term, the point and the inputs of
//          R_k.
#ifndef INVGRAD_EQUATIONS_EQUATION_SIMULATOR_H_
#define INVGRAD_EQUATIONS_EQUATION_SIMULATOR_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/simulator.h"
#include "invgrad/trial_function.h"

namespace invgrad {

// The rows of a sample's context: the jets of g and d, if the trial function
// has conditions, then w, k, the point, p and c.
struct EquationContext {
  EquationContext() = default;
  EquationContext(const TrialFunction& trial_function,
                  int num_coefficients,
                  int num_of_residual);
  int weight = 0;
  int term = 0;
  int point = 0;
  int num_coordinates = 0;
  int coefficients = 0;
  int num_coefficients = 0;
  int of_residual = 0;
  int size = 0;
};

struct EquationResidual {
  std::string name;
  std::shared_ptr<const Simulator> function;  // R_k
};

class EquationSimulator final : public Simulator {
 public:
  // At least one residual; sizes that do not fit are CHECKed.
  EquationSimulator(TrialFunction trial_function,
                    std::vector<EquationResidual> residuals,
                    int num_coefficients = 0);

  int num_inputs() const override;
  int num_outputs() const override { return num_outputs_; }
  int num_context() const override { return layout_.size; }
  const EquationContext& context_layout() const { return layout_; }

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
  // dy/dp: |y| x |p|, column-major, one sample after the other. Returns the
  // number of samples before the first that fails.
  int CoefficientJacobians(int count,
                           const double* x,
                           const double* contexts,
                           double* jacobians) const;
  std::string WhyNoLanes() const override;
  bool has_weighted_hessian() const override;
  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override;
  // "equation at the point (0.5, 0.25), where u = 1, u_t = 2, u_xx = nan"
  std::string DescribeFailure(const double* x,
                              const double* context) const override;

  const TrialFunction& trial_function() const { return trial_function_; }

 private:
  int TermOf(const double* context) const;
  // The inputs of the residuals, without p.
  Eigen::MatrixXd StatedJets(int count,
                             const double* x,
                             const double* contexts) const;
  // w R_k, and the row-major Jacobians of w R_k in its inputs, read as columns,
  // unless null.
  int EvaluateResiduals(int count,
                        const double* x,
                        const double* contexts,
                        double* y,
                        Eigen::MatrixXd* jacobians) const;
  // x_bar = covectors of x for covectors of the stated jets, of one sample: a
  // column each.
  void PullBackToNetwork(const double* context,
                         const Eigen::Ref<const Eigen::MatrixXd>& covectors,
                         Eigen::Ref<Eigen::MatrixXd> x_bar) const;

  TrialFunction trial_function_;
  std::vector<EquationResidual> residuals_;
  int num_stated_;   // |u| (1 + number of words)
  int num_outputs_;  // |y|
  EquationContext layout_;
};

}  // namespace invgrad

#endif  // INVGRAD_EQUATIONS_EQUATION_SIMULATOR_H_
