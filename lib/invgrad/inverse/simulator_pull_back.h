// The second part of a pull-back: from a wanted change of the simulator's
// output to a change of its input, for one sample.
//
//   adjoint           d_x = J^T d_y
//   inverse gradient  d_x = V S^-1 U^T d_y,      s > tau s_max,   J = U S V^T
//   half-inverse      d_x = V S^(-1/2) U^T d_y,  s > tau s_max
//   inverse           d_x = P^-1(y + d_y; x) - x, by the given inverse
//                     simulator, or the numerical one if none is given
//   numerical         the same, by the numerical inverse (numerical_inverse.h);
//                     of a linear simulator V S^-1 U^T d_y, s > max(m, n)
//                     epsilon s_max
//   newton            the same, by Newton steps (newton_inverse.h)
//   gradient descent, L-BFGS
//                     descents in x without J (descents.h), of 1/2 |P(x) - (y +
//                     d_y)|^2, or of a function that has the descent d_y, if one
//                     is given: the loss, for a gradient step in y
//
// The result x~ of an inverse is used if it is finite, has the right size and,
// if the inverse claims to reach the target,
//
//   |P(x~) - (y + d_y)| <= round_trip |d_y| + 8 epsilon |y + d_y|
//
// (with `accept_nearer`, for targets that no input reaches: if P(x~) is nearer
// to y + d_y than y is). Otherwise these follow, and no fallback moves away
// from y + d_y:
//
//   numerical inverse  with the same test
//   inverse gradient   taken if it comes nearer to y + d_y than y is
//   gradient           d_x = t J^T d_y, t = |J^T d_y|^2 / |J J^T d_y|^2, the
//                      minimizer of |J d_x - d_y| along it, halved until it
//                      comes nearer
//   none               d_x = 0
//
// A descent that fails gives d_x = 0, because the fallbacks form J; the result
// of one that succeeds is not tested.
//
// Shapes:  x, d_x: num_inputs;  y, d_y: num_outputs.
// Cost:    adjoint: one Simulator::Adjoint. Gradients: one J and, for the
//          inverse ones, its SVD; of a linear simulator one InversePower.
//          Inverse: P, the inverse, and P again for the test.
// Fails:   returns false only if the simulator has no finite value at x or
//          wanted_change returns false. Exceptions of the given inverse are
//          caught. CHECKs that the way is neither joint nor data, nor newton
//          for a simulator without second derivatives (CheckHasHessian).
//
// Source:  Holl, Koltun, Thuerey, arXiv 2109.15048, section 3; PBDL, chapter
//          physgrad-discuss, proposes such fallbacks.
#ifndef INVGRAD_INVERSE_SIMULATOR_PULL_BACK_H_
#define INVGRAD_INVERSE_SIMULATOR_PULL_BACK_H_

#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/inverse/descents.h"
#include "invgrad/inverse/newton_inverse.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/simulator.h"

namespace invgrad {

enum class SimulatorWay {
  kJoint,  // no pull-back: the rule linearizes network and simulator as one
  kAdjoint,
  kInverseGradient,
  kHalfInverse,
  kInverse,    // the problem's inverse simulator; kNumerical if it has none
  kNumerical,  // numerical_inverse.h
  kNewton,     // newton_inverse.h
  kGradientDescent,  // descents.h
  kLbfgs,
  kData,  // no pull-back: x~ is the data's solution x*
};
// In the order of the enumerators.
inline constexpr const char* kSimulatorWayNames[] = {"joint",
                                                     "adjoint",
                                                     "inverse_gradient",
                                                     "half_inverse",
                                                     "inverse",
                                                     "numerical",
                                                     "newton",
                                                     "gradient_descent",
                                                     "lbfgs",
                                                     "data"};

// The source of a sample's d_x.
enum class PullBackSource {
  kDerivative,        // sources that need no test
  kInverse,           // the given inverse, Newton's or a descent
  kNumericalInverse,  // this and the following: chosen, or a fallback
  kInverseGradient,
  kGradient,
  kNone,
};
constexpr int kNumPullBackSources = 6;

class SimulatorPullBack {
 public:
  struct Options {
    SimulatorWay way = SimulatorWay::kInverse;
    double truncation = 1e-5;  // tau
    double round_trip = 1e-3;
    bool accept_nearer = false;
    int max_num_iterations = 50;    // of the numerical inverse
    NewtonInverse::Options newton;  // of the way newton
    GradientDescentOptions gradient_descent;
    LbfgsOptions lbfgs;
  };

  // Only the way `inverse` reads the argument `inverse`, which may be null.
  SimulatorPullBack(std::shared_ptr<const Simulator> simulator,
                    std::shared_ptr<const InverseSimulator> inverse,
                    const Options& options);

  struct Result {
    PullBackSource source = PullBackSource::kDerivative;
    // Why the first choice failed; empty if it succeeded.
    std::string why;
  };

  // `wanted_change` writes d_y, given y. `x` and `context` are vectors of the
  // simulator's sizes. `function`: for the descents, may be null.
  bool operator()(const InverseSimulator::ConstVectorRef& x,
                  const InverseSimulator::ConstVectorRef& context,
                  const Simulator::Covector& wanted_change,
                  double* y,
                  Eigen::Ref<Eigen::VectorXd> d_x,
                  Result* result,
                  const OutputFunction& function = nullptr) const;

  const Simulator& simulator() const { return *simulator_; }

 private:
  class Attempt;

  bool descends() const {
    return options_.way == SimulatorWay::kGradientDescent ||
           options_.way == SimulatorWay::kLbfgs;
  }
  // Lowers 1/2 |P - wanted|^2, or `function`.
  void Descend(const InverseSimulator::ConstVectorRef& x,
               const InverseSimulator::ConstVectorRef& context,
               const Eigen::VectorXd& wanted,
               const OutputFunction& function,
               Eigen::Ref<Eigen::VectorXd> d_x,
               Result* result) const;

  std::shared_ptr<const Simulator> simulator_;
  // The first inverse to use; null: the numerical one.
  std::shared_ptr<const InverseSimulator> inverse_;
  std::shared_ptr<const InverseSimulator> numerical_;
  Options options_;
};

}  // namespace invgrad

#endif  // INVGRAD_INVERSE_SIMULATOR_PULL_BACK_H_
