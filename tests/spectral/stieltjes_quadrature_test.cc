#include "invgrad/spectral/routes/stieltjes_quadrature.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "gtest/gtest.h"

namespace invgrad {
namespace stieltjes_quadrature_test {

// The largest relative error on [lower, upper].
double LargestError(const std::vector<StieltjesNode>& nodes,
                    double p,
                    double lower,
                    double upper) {
  constexpr int kPoints = 400;
  double largest = 0.0;
  for (int i = 0; i <= kPoints; ++i) {
    const double x = lower * std::pow(upper / lower, 1.0 * i / kPoints);
    double sum = 0.0;
    for (const StieltjesNode& node : nodes) sum += node.weight / (x + node.z);
    largest = std::max(largest, std::abs(sum * std::pow(x, p) - 1.0));
  }
  return largest;
}

TEST(StieltjesQuadrature, ErrorIsAtMostTheTolerance) {
  std::vector<StieltjesNode> nodes;
  for (const double tolerance : {0.1, 1e-3, 1e-8, 1e-12}) {
    for (const double p : {0.001, 0.1, 0.5, 0.75, 0.875, 0.999}) {
      for (const double lower : {1e-20, 1e-6, 0.9}) {
        StieltjesQuadrature(p, lower, 1.0, tolerance, &nodes);
        const double error = LargestError(nodes, p, lower, 1.0);
        EXPECT_LE(error, tolerance + 1e-13)
            << p << " " << lower << " " << tolerance;
        for (const StieltjesNode& node : nodes) {
          EXPECT_GT(node.z, 0.0);
          EXPECT_GT(node.weight, 0.0);
        }
      }
    }
  }
}

// A bound a thousand times too careful would cost shifts.
TEST(StieltjesQuadrature, NumberOfNodes) {
  std::vector<StieltjesNode> nodes;
  StieltjesQuadrature(0.75, 1.0, 1.0, 1e-8, &nodes);
  EXPECT_GT(LargestError(nodes, 0.75, 1.0, 1.0), 1e-12);
  const size_t for_one = nodes.size();
  EXPECT_LE(for_one, 22u);
  StieltjesQuadrature(0.75, 1e-8, 1.0, 1e-8, &nodes);
  EXPECT_LE(nodes.size(), for_one + 21u);  // 18.4 / 0.953
}

TEST(StieltjesQuadrature, AllPowersShareTheNodesBetweenTheTails) {
  std::vector<StieltjesNode> half;
  std::vector<StieltjesNode> three_quarters;
  StieltjesQuadrature(0.5, 1e-4, 1.0, 1e-8, &half);
  StieltjesQuadrature(0.75, 1e-6, 1.0, 1e-8, &three_quarters);
  int num_shared = 0;
  for (const StieltjesNode& node : half) {
    num_shared += std::count_if(
        three_quarters.begin(),
        three_quarters.end(),
        [&](const StieltjesNode& other) { return other.z == node.z; });
  }
  EXPECT_GE(num_shared, static_cast<int>(half.size()) - 4);
}

TEST(StieltjesQuadrature, InverseIsOneNode) {
  std::vector<StieltjesNode> nodes(7);
  StieltjesQuadrature(1.0, 1e-3, 1.0, 1e-8, &nodes);
  ASSERT_EQ(nodes.size(), 1u);
  EXPECT_EQ(nodes[0].z, 0.0);
  EXPECT_EQ(nodes[0].weight, 1.0);
}

TEST(StieltjesQuadratureDeathTest, ArgumentsAreChecked) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  std::vector<StieltjesNode> nodes;
  EXPECT_DEATH(StieltjesQuadrature(0.0, 1.0, 1.0, 1e-8, &nodes), "Check");
  EXPECT_DEATH(StieltjesQuadrature(0.5, 0.0, 1.0, 1e-8, &nodes), "Check");
  EXPECT_DEATH(StieltjesQuadrature(0.5, 1.0, 1.0, 1.0, &nodes), "Check");
}

}  // namespace stieltjes_quadrature_test
}  // namespace invgrad
