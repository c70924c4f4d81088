// Solves a differential equation with its conditions by a network: a
// physics-informed network. Use it with a TrialFunction (trial_function.h),
// which satisfies initial and boundary values exactly, and train the model with
// train.h. For an evolution over a long time use time_windows.h.
//
// This header also has ValueResidual, for measurements and for conditions that
// hold only approximately, and RenewedPoints, which replaces the points of the
// equation during training.
//
//   minimize  L = sum_k weight_k 1/2 mean R_k(D u, p; c)^2,   u = g + d N
//
// Each term k has its own points: the equation inside the domain, a condition
// at the boundary that g and d do not satisfy exactly, measurements of u. Where
// g and d do, there is no term.
//
// A sample of the model is a point with a quadrature weight w_s of its term:
//
//   y = sqrt(weight_k w_s N) R_k,   L = 1 / N sum_s 1/2 |y_s|^2
//   sum_s w_s = 1 for each term
//
// Shapes:  a: d coordinates;  u: trial.num_functions;  p: coefficients.
// Cost:    equation_simulator.h; the samples hold their jets.
// Fails:   EquationSamples returns false, with *error, where a feature, g or d
//          is not finite, or if there is too little memory. Sizes that do not
//          fit are CHECKed.
//
// [1] Raissi, Perdikaris, Karniadakis. Physics-informed neural networks. J.
//     Comput. Phys. 378 (2019).
#ifndef INVGRAD_EQUATION_H_
#define INVGRAD_EQUATION_H_

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/problem.h"
#include "invgrad/data.h"
#include "invgrad/equation_points.h"
#include "invgrad/model.h"
#include "invgrad/simulator.h"
#include "invgrad/trial_function.h"

namespace invgrad {

struct EquationTerm {
  std::string name;  // in messages: "equation"
  // R_k. Its input: the values of all functions, then the derivatives of each
  // word, then p; of u and v with the word t (u, v, u_t, v_t, p).
  std::shared_ptr<const Simulator> residual;
  QuadraturePoints points;
  double weight = 1.0;
  // c at column s of the points, which has measurements, say; null: R_k has
  // none.
  std::function<void(const Eigen::VectorXd& point,
                     Eigen::Index s,
                     Eigen::Ref<Eigen::VectorXd> c)>
      context = nullptr;
};

struct Equation {
  TrialFunction trial;
  std::vector<EquationTerm> terms;
  std::vector<int> hidden;       // widths of tanh layers
  Eigen::VectorXd coefficients;  // p
};

// N: the points of all terms.
Eigen::Index NumPoints(const Equation& equation);

// Network, residuals and loss.
Model EquationModel(const Equation& equation);

// The samples of all terms, one after the other.
bool EquationSamples(const Equation& equation,
                     DataSet* samples,
                     std::string* error);

// The samples of term k alone at other points, as a set of its own.
bool TermSamples(const Equation& equation,
                 int k,
                 const QuadraturePoints& points,
                 DataSet* samples,
                 std::string* error);

// u at the points (d x N): num_functions x N.
bool Solution(const Equation& equation,
              const Eigen::VectorXd& weights,
              const Eigen::MatrixXd& points,
              Eigen::MatrixXd* u,
              std::string* error);

// An inverse problem: adds the terms of the equation to a ceres::Problem, with
// the equation's coefficients as parameter blocks.
//
//   r = y(theta, p) / sqrt(N),   1/2 |r|^2 = L(theta, p)
//
// The network's weights theta are the blocks of Network::WeightBlocks (the
// neurons); each coefficient p_i is a block of its own, which can have bounds,
// a manifold, be constant, or be shared with other residual blocks. J is
// formed: N |y| (n + |p|) numbers. `weights`, of the network of
// EquationModel(*equation), and equation->coefficients must outlive the
// problem. Returns false, with *error, if the samples have no finite values.
bool AddEquationToProblem(Equation* equation,
                          Eigen::VectorXd* weights,
                          ceres::Problem* problem,
                          std::string* error);

// A condition on the values of a function: y = u - c, with c the context. Use
// it for terms beside the equation itself, such as values at a boundary or
// measurements.
//
// Shapes:  y: 1; u is the first function. For another write a functor of all
//          inputs, as y[0] = u[1] - c[0].
class ValueResidual final : public Simulator {
 public:
  // Of an equation with this trial function and number of coefficients.
  explicit ValueResidual(const TrialFunction& trial, int num_coefficients = 0)
      : num_inputs_(trial.num_functions * trial.derivatives->num_stated() +
                    num_coefficients) {}

  int num_inputs() const override { return num_inputs_; }
  int num_outputs() const override { return 1; }
  int num_context() const override { return 1; }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override {
    *y = x[0] - context[0];
    if (jacobian != nullptr) {
      std::fill_n(jacobian, num_inputs_, 0.0);
      jacobian[0] = 1.0;
    }
    return std::isfinite(*y);
  }
  bool has_weighted_hessian() const override { return true; }
  bool WeightedHessian(const double* /*x*/,
                       const double* /*context*/,
                       const double* /*w*/,
                       double* hessian) const override {
    std::fill_n(hessian, num_inputs_ * num_inputs_, 0.0);
    return true;
  }

 private:
  int num_inputs_;
};

// Points that are renewed in training: every num_steps steps the first term of
// an equation has other points.
//
//   sequence     the next N points of the sequence in equation_points.h
//   by residual  of the next 4 N points, N that are drawn with the density
//                (1 + |R| / mean |R|) / 2 at the weights of that moment [1]
//
// A network that fits a fixed set of points can be wrong between them. Points
// drawn by residual are denser where the equation holds least, for example at a
// front. They have equal weights, so that the loss of a step weights the front
// more, too.
//
// The draw is stratified: a random place in each of N equal intervals of the
// summed density, with random numbers of the step.
//
// The samples of the other terms stay.
// Cost:    a forward pass of 4 N points by residual, and the jets of N points.
// Fails:   where EquationSamples fails, Batch logs why, and its inputs are NaN:
//          the run ends without a finite loss.
//
// [1] Wu, Zhu, Tan, Kartha, Lu. A comprehensive study of non-adaptive and
//     residual-based adaptive sampling for physics-informed neural networks.
//     CMAME 403 (2023), equation 2 with k = c = 1. arXiv 2207.10289.
class RenewedPoints final : public DataSource {
 public:
  struct Options {
    int num_steps = 50;
    bool by_residual = false;
  };

  // N: the points of the first term. The model that is trained is
  // EquationModel(equation), with any network.
  RenewedPoints(Equation equation, Box box, Options options);

  // batch_size: the points of all terms (CHECKed).
  DataSet Batch(long step,
                int batch_size,
                const Model& model,
                const Eigen::VectorXd& weights) const override;
  long steps_per_set() const override { return options_.num_steps; }
  bool needs_whole_batches() const override { return true; }
  std::string Name() const override;

 private:
  Eigen::MatrixXd DrawByResidual(const QuadraturePoints& candidates,
                                 const Model& model,
                                 const Eigen::VectorXd& weights,
                                 long set) const;

  Equation equation_;
  Box box_;
  Options options_;
};

}  // namespace invgrad

#endif  // INVGRAD_EQUATION_H_
