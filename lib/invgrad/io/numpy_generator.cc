#include <array>
#include <cmath>

#include "invgrad/random.h"

namespace invgrad {
namespace {

// numpy's SeedSequence: mixes four words of entropy into each other and hashes
// them to any number of words.
class SeedSequence {
 public:
  explicit SeedSequence(std::uint32_t seed) {
    Hash hash{0x43b0d7e5, 0x931e8875};
    pool_[0] = hash(seed);
    for (size_t i = 1; i < pool_.size(); ++i) pool_[i] = hash(0);
    for (size_t source = 0; source < pool_.size(); ++source) {
      for (size_t i = 0; i < pool_.size(); ++i) {
        if (i != source) pool_[i] = Mix(pool_[i], hash(pool_[source]));
      }
    }
  }

  // generate_state(4, np.uint64)
  std::array<std::uint64_t, 4> Words() const {
    Hash hash{0x8b51f9dd, 0x58f38ded};
    std::array<std::uint64_t, 4> words;
    for (size_t i = 0; i < words.size(); ++i) {
      const std::uint64_t low = hash(pool_[(2 * i) % pool_.size()]);
      const std::uint64_t high = hash(pool_[(2 * i + 1) % pool_.size()]);
      words[i] = (high << 32) | low;
    }
    return words;
  }

 private:
  // A hash that changes with every call.
  struct Hash {
    std::uint32_t constant;
    std::uint32_t multiplier;
    std::uint32_t operator()(std::uint32_t value) {
      value ^= constant;
      constant *= multiplier;
      value *= constant;
      return value ^ (value >> 16);
    }
  };

  static std::uint32_t Mix(std::uint32_t a, std::uint32_t b) {
    const std::uint32_t mixed = 0xca01f9dd * a - 0x4973f715 * b;
    return mixed ^ (mixed >> 16);
  }

  std::array<std::uint32_t, 4> pool_;
};

// 256 layers of one area V below f(x) = exp(-x^2 / 2), x > 0. Layer i > 0 is
// the rectangle [0, x_i] x [f_i, f_{i-1}], layer 0 the rectangle below f(r),
// r = x_255, with the tail beyond r:
//
//   x_{i-1} = f^-1(f_i + V / x_i),   x_0 = 0
//
// A draw is a layer i and a 52-bit integer u; then x = u w_i, and every x with
// u < k_i is below f.
struct Ziggurat {
  static constexpr int kLayers = 256;
  static constexpr double kTailStart = 3.6541528853610088;     // r
  static constexpr double kLayerArea = 0.0049286732339746519;  // V
  static constexpr double kScale = 4503599627370496.0;         // 2^52

  std::array<double, kLayers> w;
  std::array<std::uint64_t, kLayers> k;
  std::array<double, kLayers> f;

  Ziggurat() {
    double x = kTailStart;
    for (int i = kLayers - 1; i > 0; --i) {
      f[i] = std::exp(-0.5 * x * x);
      // This recurrence, with each operation rounded to nearest, gives all
      // entries of numpy's tables except this exponential: it lies 0.498 units
      // in the last place above the next lower double, and numpy rounds it up.
      if (i == 38) f[i] = 0x1.5ad29acc85c89p-1;
      const double below =
          i > 1 ? std::sqrt(-2.0 * std::log(f[i] + kLayerArea / x)) : 0.0;
      w[i] = x / kScale;
      k[i] = Round(below / x);
      x = below;
    }
    const double base = kLayerArea / f[kLayers - 1];  // as wide as layer 0
    w[0] = base / kScale;
    k[0] = Round(kTailStart * f[kLayers - 1] / kLayerArea);
    f[0] = 1.0;
  }

  static std::uint64_t Round(double ratio) {
    return static_cast<std::uint64_t>(std::nearbyint(ratio * kScale));
  }
};

}  // namespace

NumpyGenerator::NumpyGenerator(std::uint32_t seed) {
  const std::array<std::uint64_t, 4> words = SeedSequence(seed).Words();
  const auto join = [](std::uint64_t high, std::uint64_t low) {
    return (static_cast<Word>(high) << 64) | low;
  };
  increment_ = (join(words[2], words[3]) << 1) | 1;
  Advance();
  state_ += join(words[0], words[1]);
  Advance();
}

void NumpyGenerator::Advance() {
  constexpr Word kMultiplier =
      (static_cast<Word>(2549297995355413924ULL) << 64) |
      4865540595714422341ULL;
  state_ = state_ * kMultiplier + increment_;
}

std::uint64_t NumpyGenerator::Next() {
  Advance();
  const auto folded = static_cast<std::uint64_t>((state_ >> 64) ^ state_);
  const auto turn = static_cast<unsigned>(state_ >> 122);
  return (folded >> turn) | (folded << ((64 - turn) % 64));
}

double NumpyGenerator::Random() {
  return static_cast<double>(Next() >> 11) / 9007199254740992.0;
}

double NumpyGenerator::StandardNormal() {
  static const Ziggurat ziggurat;
  constexpr double kTailStart = Ziggurat::kTailStart;
  constexpr double kInverseTailStart = 0.27366123732975828;  // 1 / r
  while (true) {
    // From the lowest bit: 8 bits of layer, 1 of sign, 52 of u.
    const std::uint64_t bits = Next();
    const int layer = static_cast<int>(bits & 0xff);
    const std::uint64_t u = (bits >> 9) & 0xfffffffffffff;
    const double size = static_cast<double>(u) * ziggurat.w[layer];
    const double x = ((bits >> 8) & 1) != 0 ? -size : size;
    if (u < ziggurat.k[layer]) return x;
    if (layer == 0) {
      // Marsaglia's tail method, with another bit for the sign.
      while (true) {
        const double beyond = -kInverseTailStart * std::log1p(-Random());
        const double y = -std::log1p(-Random());
        if (y + y > beyond * beyond) {
          const double tail = kTailStart + beyond;
          return ((u >> 8) & 1) != 0 ? -tail : tail;
        }
      }
    }
    const double bottom = ziggurat.f[layer], top = ziggurat.f[layer - 1];
    if ((top - bottom) * Random() + bottom < std::exp(-0.5 * x * x)) return x;
  }
}

Eigen::MatrixXd NumpyGenerator::StandardNormal(int rows, int cols) {
  Eigen::MatrixXd values(rows, cols);
  for (double& value : values.reshaped<Eigen::RowMajor>())
    value = StandardNormal();
  return values;
}

}  // namespace invgrad
