#include "invgrad/rules/evidence.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace invgrad {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

constexpr int kBinsOfE = 2;  // for each factor e
constexpr int kNumBins = 64;
constexpr double kMemory = 0.77;

Index BinOf(double x) {
  if (!(x > 0.0)) return kNumBins;
  return std::min(kNumBins, static_cast<int>(-kBinsOfE * std::log(x)));
}

// The centre of a bin; the last one is everything below.
double CenterOf(Index bin) {
  return bin == kNumBins ? 0.0 : std::exp(-(bin + 0.5) / kBinsOfE);
}

}  // namespace

void Evidence::Add(const Spectrum& spectrum) {
  if (spectrum.is_empty()) return;
  const double total = spectrum.squared_coefficients.sum() + spectrum.outside;
  const Index size = spectrum.lambda.size() + spectrum.num_outside;
  const double mean = total / static_cast<double>(size);
  const double largest = spectrum.lambda.maxCoeff();
  if (!(mean > 0.0 && std::isfinite(mean) && largest > 0.0)) return;
  if (state_.size() == 0) state_.setZero(2 * (kNumBins + 1));
  auto counts = state_.head(kNumBins + 1);
  auto sums = state_.tail(kNumBins + 1);
  state_ *= kMemory;
  for (Index i = 0; i < spectrum.lambda.size(); ++i) {
    const Index bin = BinOf(spectrum.lambda[i] / largest);
    counts[bin] += 1.0;
    sums[bin] += spectrum.squared_coefficients[i] / mean;
  }
  counts[kNumBins] += static_cast<double>(spectrum.num_outside);
  sums[kNumBins] += spectrum.outside / mean;
}

Evidence::Model Evidence::Fit() const {
  Model best;
  if (state_.size() == 0) return best;
  // Of the bins that are not empty.
  Eigen::ArrayXd counts(kNumBins + 1), sums(kNumBins + 1), x(kNumBins + 1);
  Index num_bins = 0;
  for (Index bin = 0; bin <= kNumBins; ++bin) {
    if (state_[bin] == 0.0) continue;
    counts[num_bins] = state_[bin];
    sums[num_bins] = state_[kNumBins + 1 + bin];
    x[num_bins++] = CenterOf(bin);
  }
  counts.conservativeResize(num_bins);
  sums.conservativeResize(num_bins);
  x.conservativeResize(num_bins);
  const double size = counts.sum();
  double lowest = std::numeric_limits<double>::infinity();
  Eigen::ArrayXd signal, variance;
  for (const double a : {0.5, 0.75, 1.0}) {
    signal = x.pow(a);
    for (double exponent = -20.0; exponent <= 3.0; exponent += 0.25) {
      const double noise = std::pow(10.0, exponent);
      variance = signal + noise;
      // With K = scaled / size, twice the negative logarithm of the likelihood,
      // up to a constant.
      const double scaled = (sums / variance).sum();
      const double logarithms = (counts * variance.log()).sum();
      const double value = logarithms + size * std::log(scaled);
      if (value < lowest) {
        lowest = value;
        best.signal_exponent = a;
        best.noise = noise;
      }
    }
  }
  return best;
}

}  // namespace invgrad
