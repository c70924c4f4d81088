#include <cmath>
#include <utility>
#include <vector>

#include "invgrad/internal/logging.h"
#include "invgrad/trial_function.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr int kNumDerivatives = DerivativeSet::kMaxOrder + 1;

namespace {

void CheckSame(const DerivativeSet* a, const DerivativeSet* b) {
  CHECK(a == b || a == nullptr || b == nullptr || a->HasChannelsOf(*b))
      << "Jets with other derivatives, or the same in another order.";
}

}  // namespace

InputJet::InputJet(const DerivativeSet* set, Eigen::RowVectorXd jet)
    : set_(set), jet_(std::move(jet)) {
  CHECK_EQ(jet_.size(), set->num_channels());
}

InputJet& InputJet::operator+=(const InputJet& y) {
  CheckSame(set_, y.set_);
  if (set_ == nullptr) {
    const double value = this->value();
    *this = y;
    jet_[0] += value;
  } else {
    jet_.head(y.jet_.size()) += y.jet_;
  }
  return *this;
}

InputJet& InputJet::operator*=(const InputJet& y) {
  CheckSame(set_, y.set_);
  if (y.set_ == nullptr) {
    jet_ *= y.value();
  } else if (set_ == nullptr) {
    const double value = this->value();
    *this = y;
    jet_ *= value;
  } else {
    MatrixXd product = jet_;
    set_->Multiply(y.jet_, product);
    jet_ = product;
  }
  return *this;
}

InputJet& InputJet::operator/=(const InputJet& y) {
  return *this *= pow(y, -1.0);
}

InputJet InputJet::Compose(const double* derivatives) const {
  if (set_ == nullptr) return InputJet(derivatives[0]);
  InputJet result = *this;
  set_->Compose(derivatives, jet_.data(), result.jet_.data());
  return result;
}

InputJet exp(const InputJet& x) {
  const double e = std::exp(x.value());
  double derivatives[kNumDerivatives];
  for (double& d : derivatives) d = e;
  return x.Compose(derivatives);
}

InputJet log(const InputJet& x) {
  double derivatives[kNumDerivatives] = {std::log(x.value())};
  double d = 1.0;
  for (int p = 1; p < kNumDerivatives; ++p) {
    d /= x.value();
    derivatives[p] = d;
    d *= -p;
  }
  return x.Compose(derivatives);
}

InputJet sin(const InputJet& x) {
  const double s = std::sin(x.value());
  const double c = std::cos(x.value());
  const double derivatives[] = {s, c, -s, -c, s};
  static_assert(kNumDerivatives == 5);
  return x.Compose(derivatives);
}

InputJet cos(const InputJet& x) {
  const double s = std::sin(x.value());
  const double c = std::cos(x.value());
  const double derivatives[] = {c, -s, -c, s, c};
  static_assert(kNumDerivatives == 5);
  return x.Compose(derivatives);
}

InputJet tanh(const InputJet& x) {
  double derivatives[kNumDerivatives] = {x.value()};
  ActivateAll(Activation::kTanh,
              1,
              derivatives,
              DerivativeSet::kMaxOrder,
              derivatives + 1);
  return x.Compose(derivatives);
}

InputJet erfc(const InputJet& x) {
  const double z = x.value();
  const double slope = -2.0 / std::sqrt(M_PI) * std::exp(-z * z);
  // Hermite's polynomials.
  const double derivatives[] = {std::erfc(z),
                                slope,
                                -2.0 * z * slope,
                                (4.0 * z * z - 2.0) * slope,
                                (12.0 - 8.0 * z * z) * z * slope};
  static_assert(kNumDerivatives == 5);
  return x.Compose(derivatives);
}

InputJet sqrt(const InputJet& x) { return pow(x, 0.5); }

InputJet pow(const InputJet& x, double exponent) {
  double derivatives[kNumDerivatives];
  double factor = 1.0;
  for (int p = 0; p < kNumDerivatives; ++p) {
    // 0 and not 0 * infinity for a power of zero.
    derivatives[p] =
        factor == 0.0 ? 0.0 : factor * std::pow(x.value(), exponent - p);
    factor *= exponent - p;
  }
  return x.Compose(derivatives);
}

MatrixXd JetsOf(const DerivativeSet& set,
                int num_functions,
                const InputFunction& function,
                const MatrixXd& points) {
  const Index d = set.num_variables();
  const Index T = set.num_channels();
  const MatrixXd inputs = set.InputJets(points);
  MatrixXd jets = MatrixXd::Zero(num_functions * T, points.cols());
  std::vector<InputJet> point(d);
  std::vector<InputJet> values(num_functions);
  for (Index s = 0; s < points.cols(); ++s) {
    const auto jets_of_point = inputs.col(s).reshaped(d, T);
    for (Index i = 0; i < d; ++i) point[i] = {&set, jets_of_point.row(i)};
    function(point.data(), values.data());
    auto jets_of_values = jets.col(s).reshaped(num_functions, T);
    for (Index f = 0; f < num_functions; ++f) {
      CheckSame(&set, values[f].set());
      const Eigen::RowVectorXd& jet = values[f].jet();
      jets_of_values.row(f).head(jet.size()) = jet;
    }
  }
  return jets;
}

}  // namespace invgrad
