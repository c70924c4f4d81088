// A differential equation with its conditions, solved by a network: a
// physics-informed network.
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

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/data_set.h"
#include "invgrad/equation_points.h"
#include "invgrad/model.h"
#include "invgrad/simulator.h"
#include "invgrad/trial_function.h"

namespace invgrad {

struct EquationTerm {
  std::string name;                           // in messages: "equation"
  std::shared_ptr<const Simulator> residual;  // R_k
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

}  // namespace invgrad

#endif  // INVGRAD_EQUATION_H_
