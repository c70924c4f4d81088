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
  const auto counts = state_.head(kNumBins + 1);
  const auto sums = state_.tail(kNumBins + 1);
  const double size = counts.sum();
  double lowest = std::numeric_limits<double>::infinity();
  VectorXd signal(kNumBins + 1);
  for (const double a : {0.5, 0.75, 1.0}) {
    for (Index bin = 0; bin <= kNumBins; ++bin) {
      signal[bin] = std::pow(CenterOf(bin), a);
    }
    for (double exponent = -20.0; exponent <= 3.0; exponent += 0.25) {
      const double noise = std::pow(10.0, exponent);
      // With K = scaled / size, twice the negative logarithm of the likelihood,
      // up to a constant.
      double scaled = 0.0;
      double logarithms = 0.0;
      for (Index bin = 0; bin <= kNumBins; ++bin) {
        if (counts[bin] == 0.0) continue;
        const double variance = signal[bin] + noise;
        scaled += sums[bin] / variance;
        logarithms += counts[bin] * std::log(variance);
      }
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
