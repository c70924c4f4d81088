// A trial function is a network whose outputs satisfy conditions exactly, such
// as initial and boundary values. Use it to state a differential equation
// (equation.h). This header also has InputJet, the scalar that boundary values
// and other functions of a point are written on, and Features, the functions of
// a point that the network reads in place of its coordinates.
//
//   u(a; theta) = g(a) + d(a) N(phi(a); theta)
//
// Where d is zero, u = g for any weights: initial and boundary values without a
// term in the loss [1]. A d with a double zero fixes the first derivative, too.
// Features phi make u periodic, even or odd, or resolve many scales.
//
// Shapes:  a: d coordinates;  phi: features.size;  u, g, d, N: num_functions;
//          all as jets of T channels (derivative_set.h), d entry by entry.
//          In a DataSet, inputs are the jets of phi, and contexts begin with
//          the jets of g and d (ConditionSize() rows).
// Fails:   where a jet is not finite at a point, with a message that names the
//          point and the derivative.
//
// [1] Lagaris, Likas, Fotiadis. Artificial neural networks for solving ordinary
//     and partial differential equations. IEEE Trans. Neural Networks 9 (1998).
#ifndef INVGRAD_TRIAL_FUNCTION_H_
#define INVGRAD_TRIAL_FUNCTION_H_

#include <functional>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/dense_network.h"
#include "invgrad/derivative_set.h"
#include "invgrad/equation_points.h"

namespace invgrad {

// A function of a point with its derivatives, as a scalar for functors.
//
//   InputJet a: the jet (a, D_1 a, .., D_{T-1} a) of a DerivativeSet
//
// Arithmetic on InputJets gives the derivatives of what it computes, so that a
// functor written once for a point gives its derivatives, too:
//
//   [](const InputJet* a, InputJet* f) { f[0] = sin(M_PI * a[0]) * a[1]; }
//
// For data: features of a network's inputs, boundary values, exact solutions.
// Jets of one expression have the same derivatives (CHECKed).
// Cost:    a product of jets an operation, and an allocation.
// Fails:   never; outside the domain of a function its jet is not finite.
class InputJet {
 public:
  // A constant, of any set.
  InputJet(double value = 0.0)  // NOLINT: implicit on purpose
      : jet_(Eigen::RowVectorXd::Constant(1, value)) {}
  InputJet(const DerivativeSet* set, Eigen::RowVectorXd jet);

  // The derivatives that it has; null: a constant.
  const DerivativeSet* set() const { return set_; }
  double value() const { return jet_[0]; }
  // T entries; of a constant one.
  const Eigen::RowVectorXd& jet() const { return jet_; }

  InputJet operator-() const { return *this * -1.0; }
  InputJet& operator+=(const InputJet& y);
  InputJet& operator-=(const InputJet& y) { return *this += -y; }
  InputJet& operator*=(const InputJet& y);
  InputJet& operator/=(const InputJet& y);
  friend InputJet operator+(InputJet x, const InputJet& y) { return x += y; }
  friend InputJet operator-(InputJet x, const InputJet& y) { return x -= y; }
  friend InputJet operator*(InputJet x, const InputJet& y) { return x *= y; }
  friend InputJet operator/(InputJet x, const InputJet& y) { return x /= y; }

  friend InputJet exp(const InputJet& x);
  friend InputJet log(const InputJet& x);
  friend InputJet sin(const InputJet& x);
  friend InputJet cos(const InputJet& x);
  friend InputJet tanh(const InputJet& x);
  friend InputJet erfc(const InputJet& x);
  friend InputJet sqrt(const InputJet& x);
  friend InputJet pow(const InputJet& x, double exponent);

 private:
  // phi(x) for derivatives[p] = phi^(p)(x_0), p = 0 .. kMaxOrder.
  InputJet Compose(const double* derivatives) const;

  const DerivativeSet* set_ = nullptr;  // null: a constant
  Eigen::RowVectorXd jet_;
};

// Functions of a point: their values, for the jets of the point's coordinates.
using InputFunction =
    std::function<void(const InputJet* point, InputJet* values)>;

// The jets of num_functions functions at points (d x N): num_functions T x N,
// with the values of channel 0 first, then those of channel 1, and so on.
Eigen::MatrixXd JetsOf(const DerivativeSet& set,
                       int num_functions,
                       const InputFunction& function,
                       const Eigen::MatrixXd& points);

// Features of a point, as inputs of a network in place of the coordinates.
//
//   scaled     a_i from its interval in the box to [-1, 1]
//   periodic   cos(2 pi k (a_i - lower) / period), sin(..), k = 1 .. K: the
//              network is periodic in a_i, with all derivatives
//   Fourier    cos(b_j . a), sin(b_j . a): functions of many scales [1]
//
// Any other function on InputJets serves as well.
// Cost:    once a point, in the samples.
//
// [1] Tancik et al. Fourier features let networks learn high frequency
//     functions in low dimensional domains. NeurIPS 2020. arXiv 2006.10739,
//     equation 2.
struct Features {
  int size = 0;
  InputFunction function;  // null: the coordinates
};

Features ScaledFeatures(const Box& box);

// The other coordinates are scaled. Of coordinate i: cosines and sines in turn.
// A period that is not the width of the box is allowed.
Features PeriodicFeatures(const Box& box,
                          int coordinate,
                          double period,
                          int num_waves = 1);

// frequencies: a row b_j each, often normal random numbers; 2 features a row,
// first all cosines.
Features FourierFeatures(const Eigen::MatrixXd& frequencies);

struct TrialFunction {
  std::shared_ptr<const DerivativeSet> derivatives;
  int num_functions = 1;
  Features features;  // none: the coordinates
  // Both null: u = N.
  InputFunction boundary_values;  // g; null beside a d: 0
  InputFunction distance;         // d

  bool has_conditions() const {
    return boundary_values != nullptr || distance != nullptr;
  }
  int NumInputs() const;      // |phi|
  int ConditionSize() const;  // 2 num_functions T, or 0

  // The jets of phi at the points (d x N): |phi| T x N.
  bool Inputs(const Eigen::MatrixXd& points,
              Eigen::MatrixXd* inputs,
              std::string* error) const;
  // The jets of g, then those of d: ConditionSize() x N.
  bool Conditions(const Eigen::MatrixXd& points,
                  Eigen::MatrixXd* conditions,
                  std::string* error) const;

  // The jets of u for those of N: num_functions T x N. Only the first
  // ConditionSize() rows of `contexts` are read.
  Eigen::MatrixXd Values(const Eigen::MatrixXd& network_jets,
                         const Eigen::MatrixXd& contexts) const;
};

// u at a point, with the derivatives that the point has.
void EvaluateTrialFunction(const TrialFunction& trial,
                           const DenseNetwork& network,
                           const Eigen::VectorXd& weights,
                           const InputJet* point,
                           InputJet* u);

}  // namespace invgrad

#endif  // INVGRAD_TRIAL_FUNCTION_H_
