#include "invgrad/derivative_set.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Eigen::ArrayXd;
using Eigen::ArrayXXd;
using Eigen::Index;
using Eigen::MatrixXd;

double Binomial(int n, int k) {
  double b = 1.0;
  for (int i = 1; i <= k; ++i) b = b * (n - k + i) / i;
  return b;
}

// All beta <= alpha.
std::vector<std::vector<int>> SubIndices(const std::vector<int>& alpha) {
  std::vector<std::vector<int>> all = {{}};
  for (const int order : alpha) {
    std::vector<std::vector<int>> longer;
    for (const std::vector<int>& beta : all) {
      for (int i = 0; i <= order; ++i) {
        longer.push_back(beta);
        longer.back().push_back(i);
      }
    }
    all.swap(longer);
  }
  return all;
}

}  // namespace

DerivativeSet::DerivativeSet(std::string variables,
                             const std::vector<std::string>& words)
    : variables_(std::move(variables)) {
  std::string sorted = variables_;
  std::sort(sorted.begin(), sorted.end());
  CHECK(std::adjacent_find(sorted.begin(), sorted.end()) == sorted.end() &&
        sorted.find('+') == std::string::npos)
      << "variables \"" << variables_ << "\": a different letter each.";
  Add(Parse(""));
  for (const std::string& word : words) {
    CHECK(!word.empty()) << "The value is channel 0, without a word.";
    const int k = Add(Parse(word));
    CHECK_EQ(k, num_stated_)
        << "The derivative " << word << " is stated twice.";
    ++num_stated_;
  }
  // Channels that are added need none that are not among them already.
  for (int k = 0; k < num_stated_; ++k) AddNeeded(k);
  for (int k = 0; k < num_channels(); ++k) AddTerms(k);
  ascending_.resize(channels_.size());
  std::iota(ascending_.begin(), ascending_.end(), 0);
  std::stable_sort(ascending_.begin(), ascending_.end(), [this](int k, int l) {
    return channels_[k].order < channels_[l].order;
  });
  order_ = channels_[ascending_.back()].order;
}

std::shared_ptr<const DerivativeSet> DerivativeSet::Values() {
  static const auto* const values = new std::shared_ptr<const DerivativeSet>(
      std::make_shared<DerivativeSet>("", std::vector<std::string>()));
  return *values;
}

DerivativeSet::Channel DerivativeSet::Parse(const std::string& word) const {
  const auto variable = [&](char letter) {
    const std::size_t i = variables_.find(letter);
    CHECK(i != std::string::npos)
        << "The derivative " << word << ": " << letter
        << " is not one of the variables \"" << variables_
        << "\". The word for u_tt is tt.";
    return static_cast<int>(i);
  };
  Channel channel;
  channel.word = word;
  if (word.find('+') == std::string::npos) {
    channel.orders.assign(variables_.size(), 0);
    for (const char letter : word) ++channel.orders[variable(letter)];
    channel.order = static_cast<int>(word.size());
    CHECK_LE(channel.order, kMaxOrder)
        << "The derivative " << word << " is of an order above " << kMaxOrder;
    return channel;
  }
  // "xx+yy"
  for (std::size_t at = 0; at < word.size(); at += 3) {
    CHECK(at + 2 <= word.size() && word[at] == word[at + 1] &&
          (at + 2 == word.size() ||
           (word[at + 2] == '+' && at + 3 < word.size())))
        << "The derivative " << word
        << " is not a sum of second derivatives, such as xx+yy.";
    channel.summed.push_back(variable(word[at]));
  }
  std::sort(channel.summed.begin(), channel.summed.end());
  CHECK(std::adjacent_find(channel.summed.begin(), channel.summed.end()) ==
        channel.summed.end())
      << "The derivative " << word << " has a variable twice.";
  channel.order = 2;
  return channel;
}

int DerivativeSet::Find(const Channel& channel) const {
  const auto found =
      std::find_if(channels_.begin(), channels_.end(), [&](const Channel& c) {
        return c.orders == channel.orders && c.summed == channel.summed;
      });
  return found == channels_.end() ? -1
                                  : static_cast<int>(found - channels_.begin());
}

int DerivativeSet::Add(const Channel& channel) {
  const int found = Find(channel);
  if (found >= 0) return found;
  channels_.push_back(channel);
  return num_channels() - 1;
}

void DerivativeSet::AddNeeded(int k) {
  const auto add = [this](const std::vector<int>& orders) {
    Channel needed;
    needed.orders = orders;
    for (std::size_t i = 0; i < orders.size(); ++i) {
      needed.word.append(orders[i], variables_[i]);
    }
    needed.order = static_cast<int>(needed.word.size());
    Add(needed);
  };
  const Channel channel = channels_[k];
  for (const std::vector<int>& beta : SubIndices(channel.orders)) {
    if (!beta.empty()) add(beta);
  }
  for (const int i : channel.summed) {
    std::vector<int> first(variables_.size(), 0);
    first[i] = 1;
    add(first);
  }
}

void DerivativeSet::AddTerms(int k) {
  const Channel& channel = channels_[k];
  std::vector<Term> terms;
  const auto find = [this](const std::vector<int>& orders) {
    Channel needed;
    needed.orders = orders;
    return Find(needed);
  };
  if (channel.summed.empty()) {
    for (const std::vector<int>& beta : SubIndices(channel.orders)) {
      std::vector<int> rest = channel.orders;
      double c = 1.0;
      for (std::size_t i = 0; i < beta.size(); ++i) {
        rest[i] -= beta[i];
        c *= Binomial(channel.orders[i], beta[i]);
      }
      const int i = find(beta);
      const int j = find(rest);
      if (i != 0 && j != 0) terms.push_back({i, j, c});
    }
  }
  for (const int i : channel.summed) {
    std::vector<int> first(variables_.size(), 0);
    first[i] = 1;
    terms.push_back({find(first), find(first), 2.0});
  }
  channels_[k].terms = std::move(terms);
}

int DerivativeSet::ChannelOf(const std::string& word) const {
  const int k = Find(Parse(word));
  CHECK_GE(k, 0) << "The derivative " << word << " is not in the set.";
  return k;
}

bool DerivativeSet::HasChannelsOf(const DerivativeSet& other) const {
  return variables_ == other.variables_ &&
         std::equal(channels_.begin(),
                    channels_.end(),
                    other.channels_.begin(),
                    other.channels_.end(),
                    [](const Channel& a, const Channel& b) {
                      return a.orders == b.orders && a.summed == b.summed;
                    });
}

MatrixXd DerivativeSet::InputJets(const MatrixXd& points) const {
  const Index d = num_variables();
  CHECK_EQ(points.rows(), d);
  MatrixXd jets = MatrixXd::Zero(d * num_channels(), points.cols());
  jets.topRows(d) = points;
  for (int k = 1; k < num_channels(); ++k) {
    if (channels_[k].order > 1) continue;
    const auto& orders = channels_[k].orders;
    const Index i = std::find(orders.begin(), orders.end(), 1) - orders.begin();
    jets.row(k * d + i).setOnes();
  }
  return jets;
}

void DerivativeSet::CheckShapes(const Eigen::Ref<const MatrixXd>& factors,
                                const Eigen::Ref<MatrixXd>& values) const {
  CHECK_EQ(factors.rows(), values.rows());
  CHECK_EQ(factors.cols(), values.cols());
  CHECK_EQ(values.cols() % num_channels(), 0);
}

template <typename Z>
void DerivativeSet::ComputePowers(const Z& z,
                                  std::vector<ArrayXXd>* powers) const {
  powers->resize(std::max(order_ - 1, 0));
  for (int p = 2; p <= order_; ++p) {
    ArrayXXd& power = (*powers)[p - 2];
    power.setZero(z.rows(), num_channels());
    for (int k = 0; k < num_channels(); ++k) {
      if (channels_[k].order < p) continue;
      for (const Term& term : channels_[k].terms) {
        if (p == 2) {
          power.col(k) += term.c * z.col(term.i) * z.col(term.j);
        } else {
          power.col(k) += term.c * z.col(term.i) * (*powers)[p - 3].col(term.j);
        }
      }
    }
  }
}

namespace {

// sum_p derivatives[p] / p! n^p. Channel 0 of z is not read, so that z may be
// the result.
template <typename Derivatives, typename Z, typename Result>
void SumOfPowers(const Derivatives& derivatives,
                 const std::vector<int>& orders,
                 const std::vector<ArrayXXd>& powers,
                 const Z& z,
                 Result result) {
  result.col(0) = derivatives(0);
  for (Index k = 1; k < z.cols(); ++k) {
    result.col(k) = derivatives(1) * z.col(k);
    double factorial = 1.0;
    for (int p = 2; p <= orders[k]; ++p) {
      factorial *= p;
      result.col(k) += derivatives(p) / factorial * powers[p - 2].col(k);
    }
  }
}

}  // namespace

void DerivativeSet::Activate(Activation activation,
                             Eigen::Ref<MatrixXd> z,
                             MatrixXd* slopes,
                             MatrixXd* curvatures) const {
  CheckShapes(*slopes, z);
  if (curvatures != nullptr) CheckShapes(*curvatures, z);
  const int T = num_channels();
  const int size = static_cast<int>(z.rows());
  if (T == 1 && curvatures == nullptr) {
    for (Index s = 0; s < z.cols(); ++s) {
      ActivateAll(activation, size, z.col(s).data(), 1, slopes->col(s).data());
    }
    return;
  }
  const int num_derivatives = order_ + (curvatures == nullptr ? 1 : 2);
  std::vector<int> orders(T);
  for (int k = 0; k < T; ++k) orders[k] = channels_[k].order;
  // Column p - 1: phi^(p).
  ArrayXXd derivatives(size, num_derivatives);
  ArrayXd value(size);
  std::vector<ArrayXXd> powers;
  for (Index s = 0; s < z.cols(); s += T) {
    auto jets = z.middleCols(s, T).array();
    value = jets.col(0);
    ActivateAll(
        activation, size, value.data(), num_derivatives, derivatives.data());
    const auto of_slope = [&](int p) { return derivatives.col(p); };
    const auto of_curvature = [&](int p) { return derivatives.col(p + 1); };
    ComputePowers(jets, &powers);
    SumOfPowers(
        of_slope, orders, powers, jets, slopes->middleCols(s, T).array());
    if (curvatures != nullptr) {
      SumOfPowers(of_curvature,
                  orders,
                  powers,
                  jets,
                  curvatures->middleCols(s, T).array());
    }
    SumOfPowers(
        [&](int p) -> ArrayXXd::ConstColXpr {
          return std::as_const(derivatives).col(std::max(p - 1, 0));
        },
        orders,
        powers,
        jets,
        jets);
    jets.col(0) = value;
  }
}

void DerivativeSet::Multiply(const Eigen::Ref<const MatrixXd>& factors,
                             Eigen::Ref<MatrixXd> values) const {
  CheckShapes(factors, values);
  const int T = num_channels();
  if (T == 1) {
    values.array() *= factors.array();
    return;
  }
  for (Index s = 0; s < values.cols(); s += T) {
    const auto f = factors.middleCols(s, T).array();
    auto v = values.middleCols(s, T).array();
    // From the highest order to the lowest: each channel reads lower ones.
    for (int at = T - 1; at >= 0; --at) {
      const int k = ascending_[at];
      v.col(k) *= f.col(0);
      if (k == 0) continue;
      v.col(k) += f.col(k) * v.col(0);
      for (const Term& term : channels_[k].terms) {
        v.col(k) += term.c * f.col(term.i) * v.col(term.j);
      }
    }
  }
}

void DerivativeSet::MultiplyTransposed(
    const Eigen::Ref<const MatrixXd>& factors,
    Eigen::Ref<MatrixXd> covectors) const {
  CheckShapes(factors, covectors);
  const int T = num_channels();
  if (T == 1) {
    covectors.array() *= factors.array();
    return;
  }
  for (Index s = 0; s < covectors.cols(); s += T) {
    const auto f = factors.middleCols(s, T).array();
    auto w = covectors.middleCols(s, T).array();
    // Channel k is read by lower ones before it is scaled.
    for (const int k : ascending_) {
      for (const Term& term : channels_[k].terms) {
        w.col(term.j) += term.c * f.col(term.i) * w.col(k);
      }
      if (k > 0) w.col(0) += f.col(k) * w.col(k);
      w.col(k) *= f.col(0);
    }
  }
}

void DerivativeSet::Compose(const double* derivatives,
                            const double* z,
                            double* result) const {
  const Eigen::Map<const Eigen::Array<double, 1, Eigen::Dynamic>> jet(
      z, num_channels());
  std::vector<int> orders;
  for (const Channel& channel : channels_) orders.push_back(channel.order);
  std::vector<ArrayXXd> powers;
  ComputePowers(jet, &powers);
  SumOfPowers([&](int p) { return derivatives[p]; },
              orders,
              powers,
              jet,
              Eigen::Map<Eigen::Array<double, 1, Eigen::Dynamic>>(
                  result, num_channels()));
}

}  // namespace invgrad
