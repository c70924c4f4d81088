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
// Cost:    a product of jets an operation, and an allocation.
// Fails:   never; outside the domain of a function its jet is not finite.
#ifndef INVGRAD_EQUATIONS_INPUT_JET_H_
#define INVGRAD_EQUATIONS_INPUT_JET_H_

#include <functional>
#include <memory>

#include "Eigen/Core"
#include "invgrad/derivative_set.h"

namespace invgrad {

class InputJet {
 public:
  // A constant, of any set.
  InputJet(double value = 0.0)  // NOLINT: implicit on purpose
      : jet_(Eigen::RowVectorXd::Constant(1, value)) {}
  InputJet(const DerivativeSet* set, Eigen::RowVectorXd jet);

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

}  // namespace invgrad

#endif  // INVGRAD_EQUATIONS_INPUT_JET_H_
