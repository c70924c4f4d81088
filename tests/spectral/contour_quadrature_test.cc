#include "invgrad/spectral/routes/contour_quadrature.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "gtest/gtest.h"

namespace invgrad {
namespace contour_quadrature_test {

using Complex = std::complex<double>;
using Function = std::function<Complex(Complex)>;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

std::vector<ContourNode> Nodes(double below,
                               double above,
                               double upper,
                               double tolerance) {
  std::vector<ContourNode> nodes;
  ContourQuadrature(below, above, upper, tolerance, &nodes);
  return nodes;
}

double Apply(const std::vector<ContourNode>& nodes,
             const Function& f,
             double x) {
  double sum = 0.0;
  for (const ContourNode& node : nodes) {
    sum += (node.weight * f(node.z) / (node.z - x)).imag();
  }
  return sum;
}

double LargestOnContour(const std::vector<ContourNode>& nodes,
                        const Function& f) {
  double largest = 0.0;
  for (const ContourNode& node : nodes) {
    largest = std::max(largest, std::abs(f(node.z)));
  }
  return largest;
}

// From low to high, both included, equally spaced in log(x - origin).
std::vector<double> LogSpaced(double origin, double low, double high) {
  constexpr int kCount = 40;
  std::vector<double> x = {low, high};
  const double ratio = (high - origin) / (low - origin);
  for (int i = 1; i < kCount; ++i) {
    x.push_back(origin + (low - origin) * std::pow(ratio, double(i) / kCount));
  }
  return x;
}

struct NamedFunction {
  std::string name;
  Function f;
};

// Those of the spectral filters: phi(s) / s with lambda = s^2.
std::vector<NamedFunction> Functions(double damping) {
  std::vector<NamedFunction> functions;
  for (const double p : {0.25, 0.5, 0.75, 1.0}) {
    functions.push_back({"x^-" + std::to_string(p),
                         [p](Complex z) { return std::pow(z, -p); }});
  }
  functions.push_back({"1 / (x + damping)",
                       [damping](Complex z) { return 1.0 / (z + damping); }});
  functions.push_back({"1", [](Complex) { return Complex(1.0); }});
  return functions;
}

// The largest error on the kept interval and below, in units of the largest
// |f| on the contour.
double RelativeError(const std::vector<ContourNode>& nodes,
                     const Function& f,
                     const std::vector<double>& kept,
                     const std::vector<double>& dropped) {
  double error = 0.0;
  for (const double x : kept) {
    error = std::max(error, std::abs(Apply(nodes, f, x) - f(x).real()));
  }
  for (const double x : dropped) {
    error = std::max(error, std::abs(Apply(nodes, f, x)));
  }
  return error / LargestOnContour(nodes, f);
}

// The gap between dropped and kept shrinks until it is no wider than a
// rounding of the largest value: the spectrum of a Gram matrix. f is singular
// at the end of the gap, and dropped are values at least as far from it again.
TEST(ContourQuadrature, KeepsTheFunctionAboveAndDropsItBelow) {
  constexpr double kTolerance = 1e-14;
  for (const double gap : {0.5, 1e-1, 1e-3, 1e-6, 1e-9, 1e-12, 1e-15}) {
    const auto nodes = Nodes(0.0, gap, 1.0, kTolerance);
    const std::vector<double> kept = LogSpaced(0.0, gap, 1.0);
    const std::vector<double> dropped = {-gap, -3.0 * gap, -1.0, -1e3};
    for (const auto& [name, f] : Functions(1e-3 * gap)) {
      // Each node's term has a rounding, and the terms' sizes add up to some
      // log(1 / gap) times the largest |f|.
      EXPECT_LE(RelativeError(nodes, f, kept, dropped),
                4.0 * kTolerance + 10.0 * kEpsilon * (1.0 - std::log(gap)))
          << name << ", gap " << gap;
    }
  }
}

// f / (z - x) with x at f's own singularity has a stronger one there, of order
// 2 p in the coordinate in which the rule is a midpoint rule: the error grows
// as N^(2p). The routes shrink the gap by a tenth, which avoids it.
TEST(ContourQuadrature, IsLessAccurateAtASingularity) {
  constexpr double kTolerance = 1e-12;
  for (const double gap : {0.5, 1e-6, 1e-15}) {
    const auto nodes = Nodes(0.0, gap, 1.0, kTolerance);
    const Function inverse = [](Complex z) { return 1.0 / z; };
    const double at = RelativeError(nodes, inverse, {}, {0.0});
    EXPECT_LE(at, 2000.0 * kTolerance);
    EXPECT_GE(at, 0.5 * kTolerance);
    // As in the routes: a tenth of the gap away from the singularity.
    const auto shrunk = Nodes(0.1 * gap, 0.9 * gap, 1.0, kTolerance);
    EXPECT_LE(
        RelativeError(shrunk, inverse, LogSpaced(0.1 * gap, gap, 1.0), {0.0}),
        30.0 * kTolerance + 10.0 * kEpsilon * (1.0 - std::log(gap)));
  }
}

// A gap at x = 1: 1 is a large number beside the gap, and z - x has roundings.
TEST(ContourQuadrature, GapFarFromTheSingularity) {
  constexpr double kTolerance = 1e-14;
  for (const double gap : {0.5, 1e-2, 1e-4, 1e-6}) {
    const double below = 1.0 - 0.5 * gap;
    const double above = 1.0 + 0.5 * gap;
    const auto nodes = Nodes(below, above, 30.0, kTolerance);
    const std::vector<double> kept = LogSpaced(below, above, 30.0);
    const std::vector<double> dropped = {below, 0.5, 0.0, -30.0};
    for (const auto& [name, f] : Functions(0.0)) {
      EXPECT_LE(RelativeError(nodes, f, kept, dropped),
                4.0 * kTolerance + 10.0 * kEpsilon / gap)
          << name << ", gap " << gap;
    }
  }
}

TEST(ContourQuadrature, NumberOfNodesIsAsStated) {
  for (const double gap : {0.5, 1e-3, 1e-9, 1e-15}) {
    for (const double tolerance : {1e-2, 1e-8, 1e-15}) {
      const double stated = std::log(1.0 / tolerance) *
                            (std::log(1.0 / gap) + 3.0) /
                            (3.14159265358979323846 * 3.14159265358979323846);
      const auto size =
          static_cast<double>(Nodes(0.0, gap, 1.0, tolerance).size());
      EXPECT_GE(size, stated - 1e-9);
      EXPECT_LT(size, stated + 1.0);
    }
  }
  // The header's examples.
  EXPECT_EQ(Nodes(0.0, 1e-3, 1.0, 1e-14).size(), 33u);
  EXPECT_EQ(Nodes(0.0, 1e-9, 1.0, 1e-14).size(), 78u);
  EXPECT_EQ(Nodes(0.0, 1e-15, 1.0, 1e-14).size(), 123u);
}

// The number of nodes is proportional to log(1 / tolerance), and the error
// falls with the tolerance: neither worse than promised nor much better, which
// would be nodes wasted.
TEST(ContourQuadrature, ConvergesGeometrically) {
  for (const double gap : {1e-2, 1e-6, 1e-10}) {
    const std::vector<double> kept = LogSpaced(0.0, gap, 1.0);
    const std::vector<double> dropped = {-gap, -1.0};
    for (const auto& [name, f] : Functions(0.0)) {
      for (const double tolerance : {1e-2, 1e-4, 1e-6, 1e-8, 1e-10}) {
        const double error =
            RelativeError(Nodes(0.0, gap, 1.0, tolerance), f, kept, dropped);
        EXPECT_LE(error, 5.0 * tolerance) << name << ", gap " << gap;
        EXPECT_GE(error, 1e-3 * tolerance) << name << ", gap " << gap;
      }
    }
  }
}

// The circle is its own mirror image: the nodes come in pairs of product
// (above - below) (upper - below), all in the upper half-plane.
TEST(ContourQuadrature, NodesAreSymmetric) {
  for (const double gap : {0.5, 1e-7, 1e-14}) {
    for (const double tolerance : {1e-5, 1e-6}) {  // even and odd numbers
      const auto nodes = Nodes(0.0, gap, 1.0, tolerance);
      for (size_t j = 0; j < nodes.size(); ++j) {
        EXPECT_GT(nodes[j].z.imag(), 0.0);
        const Complex mirrored = std::conj(nodes[nodes.size() - 1 - j].z);
        EXPECT_LE(std::abs(nodes[j].z * mirrored - gap), 100 * kEpsilon * gap);
      }
    }
  }
}

// Nodes and weights have the units of x.
TEST(ContourQuadrature, ScalesAndShiftsWithX) {
  const auto nodes = Nodes(0.0, 1e-5, 1.0, 1e-12);
  const double scale = std::ldexp(1.0, 200);
  const auto scaled = Nodes(0.0, 1e-5 * scale, scale, 1e-12);
  const auto shifted = Nodes(4.0, 4.0 + std::ldexp(1.0, -10), 5.0, 1e-12);
  const auto at_zero = Nodes(0.0, std::ldexp(1.0, -10), 1.0, 1e-12);
  ASSERT_EQ(scaled.size(), nodes.size());
  for (size_t j = 0; j < nodes.size(); ++j) {
    // log(kappa) is a difference of larger numbers now.
    EXPECT_LE(std::abs(scaled[j].z / scale - nodes[j].z),
              1e-12 * std::abs(nodes[j].z));
    EXPECT_LE(std::abs(scaled[j].weight / scale - nodes[j].weight),
              1e-12 * std::abs(nodes[j].weight));
  }
  ASSERT_EQ(shifted.size(), at_zero.size());
  for (size_t j = 0; j < shifted.size(); ++j) {
    EXPECT_LE(std::abs(shifted[j].z - 4.0 - at_zero[j].z), 8 * kEpsilon);
    EXPECT_EQ(shifted[j].weight, at_zero[j].weight);
  }
}

TEST(ContourQuadrature, Repeats) {
  const auto nodes = Nodes(0.0, 1e-9, 1.0, 1e-15);
  std::vector<ContourNode> again(1000);
  ContourQuadrature(0.0, 1e-9, 1.0, 1e-15, &again);
  ASSERT_EQ(again.size(), nodes.size());
  for (size_t j = 0; j < nodes.size(); ++j) {
    EXPECT_EQ(again[j].z, nodes[j].z);
    EXPECT_EQ(again[j].weight, nodes[j].weight);
  }
}

TEST(ContourQuadratureDeathTest, ChecksItsArguments) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  EXPECT_DEATH(Nodes(1.0, 1.0, 2.0, 1e-9), "below < above");
  EXPECT_DEATH(Nodes(0.0, 2.0, 2.0, 1e-9), "above < upper");
  EXPECT_DEATH(Nodes(kNaN, 1.0, 2.0, 1e-9), "below < above");
  EXPECT_DEATH(Nodes(0.0, 1.0, kNaN, 1e-9), "above < upper");
  for (const double tolerance : {0.0, -1.0, 1.0, kNaN}) {
    EXPECT_DEATH(Nodes(0.0, 1.0, 2.0, tolerance), "tolerance");
  }
}

}  // namespace contour_quadrature_test
}  // namespace invgrad
