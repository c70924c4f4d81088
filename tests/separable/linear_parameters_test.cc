#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/separable.h"

namespace invgrad {
namespace linear_parameters_test {

using std::exp;
using std::pow;

// The linear parameters of a residual f(b).
template <int N, typename Function>
std::vector<int> Linear(const Function& f) {
  const auto functor = [f](const auto* b, auto* r) {
    r[0] = f(b);
    return true;
  };
  double b[N];
  for (int i = 0; i < N; ++i) b[i] = 1.0 + i;
  return LinearParameters<N>(functor, 1, b);
}

using Set = std::vector<int>;

TEST(LinearParameters, OfSumsAndProducts) {
  EXPECT_EQ(Linear<2>([](auto b) { return 3.0 * b[0] - b[1] / 2.0 + 1.0; }),
            (Set{0, 1}));
  EXPECT_EQ(Linear<2>([](auto b) { return b[0] * b[1]; }), (Set{0}));
  EXPECT_EQ(Linear<1>([](auto b) { return b[0] * b[0]; }), (Set{}));
  EXPECT_EQ(Linear<2>([](auto b) { return b[0] / b[1]; }), (Set{0}));
  EXPECT_EQ(Linear<3>([](auto b) { return (b[0] + b[1]) * b[2]; }),
            (Set{0, 1}));
  // Two of three that multiply each other in a circle are never free.
  EXPECT_EQ(
      Linear<3>([](auto b) { return b[0] * b[1] + b[1] * b[2] + b[2] * b[0]; }),
      (Set{0}));
  EXPECT_EQ(Linear<2>([](auto b) { return -(+b[0]) - b[1]; }), (Set{0, 1}));
}

TEST(LinearParameters, OfFunctions) {
  EXPECT_EQ(Linear<4>([](auto b) {
              return b[0] * exp(-b[1] * 2.0) + b[2] * exp(-b[3] * 2.0);
            }),
            (Set{0, 2}));
  EXPECT_EQ(Linear<2>([](auto b) { return b[0] * pow(2.0, b[1]); }), (Set{0}));
  EXPECT_EQ(Linear<3>([](auto b) { return exp(b[0] + b[1]) + b[2]; }),
            (Set{2}));
  EXPECT_EQ(Linear<2>([](auto b) { return atan2(b[0], 2.0 * b[1]); }), (Set{}));
}

TEST(LinearParameters, OfSeveralResidualsAndAssignments) {
  const auto functor = [](const auto* b, auto* r) {
    r[0] = b[0];
    r[0] += b[1];
    r[0] *= 2.0;
    r[1] = b[2];
    r[1] -= b[0];
    r[1] /= b[3];
    return true;
  };
  const double b[] = {1.0, 2.0, 3.0, 4.0};
  EXPECT_EQ(LinearParameters<4>(functor, 2, b), (Set{0, 1, 2}));
}

// abs by a comparison: linear in each branch, but not linear.
TEST(LinearParameters, OfBranches) {
  EXPECT_EQ(Linear<2>([](auto b) { return b[0] < 0.0 ? -b[0] : b[0] + b[1]; }),
            (Set{1}));
  EXPECT_EQ(Linear<2>([](auto b) { return b[0] + b[1]; }), (Set{0, 1}));
  EXPECT_EQ(Linear<2>([](auto b) { return abs(b[0]) + b[1]; }), (Set{1}));
}

TEST(LinearParameters, OfAFunctorThatFails) {
  const auto functor = [](const auto*, auto*) { return false; };
  const double b = 1.0;
  EXPECT_EQ(LinearParameters<1>(functor, 1, &b), (Set{}));
}

// Thirty amplitudes in one block: the search ends at the first set.
TEST(LinearParameters, OfManyParameters) {
  EXPECT_EQ(Linear<60>([](auto b) {
              auto sum = b[0] * b[1];
              for (int i = 2; i < 60; i += 2) sum += b[i] * exp(b[i + 1]);
              return sum;
            }).size(),
            30u);
}

// sum b_i b_j over the edges (i, j).
struct EdgeProducts {
  template <typename T>
  bool operator()(const T* b, T* r) const {
    r[0] = T(0.0);
    for (const auto& [i, j] : edges) r[0] += b[i] * b[j];
    return true;
  }
  std::vector<std::pair<int, int>> edges;
};

// The largest independent set, of several the lexicographically first.
template <int N>
Set LargestOfAllSubsets(const EdgeProducts& products) {
  Set largest;
  for (unsigned subset = 0; subset < (1u << N); ++subset) {
    // In lexicographic order, for sets of one size.
    const auto has = [&](int i) { return (subset >> (N - 1 - i) & 1u) == 0; };
    Set set;
    for (int i = 0; i < N; ++i) {
      if (has(i)) set.push_back(i);
    }
    if (set.size() > largest.size() && std::none_of(products.edges.begin(),
                                                    products.edges.end(),
                                                    [&](const auto& edge) {
                                                      return has(edge.first) &&
                                                             has(edge.second);
                                                    })) {
      largest = set;
    }
  }
  return largest;
}

TEST(LinearParameters, AreTheFirstLargestSetOfARandomGraph) {
  constexpr int kSize = 8;
  const std::vector<double> b(kSize, 1.0);
  std::mt19937 random(1);
  for (int graph = 0; graph < 200; ++graph) {
    EdgeProducts products;
    for (int i = 0; i < kSize; ++i) {
      for (int j = i; j < kSize; ++j) {
        if (random() % 8 < static_cast<unsigned>(graph % 4)) {
          products.edges.emplace_back(i, j);
        }
      }
    }
    EXPECT_EQ(LinearParameters<kSize>(products, 1, b.data()),
              LargestOfAllSubsets<kSize>(products));
  }
}

// Nonlinear parameters do not multiply the time of the search, nor do pairs,
// chains and products of two groups.
TEST(LinearParameters, OfManyParametersAreFoundAtOnce) {
  constexpr int kSize = 80;
  constexpr int kNumNonlinear = 10;
  const std::vector<double> b(kSize, 1.0);
  EdgeProducts nonlinear;
  for (int k = 0; k < kNumNonlinear; ++k) nonlinear.edges.emplace_back(k, k);
  EXPECT_EQ(LinearParameters<kSize>(nonlinear, 1, b.data()).size(),
            kSize - kNumNonlinear);
  constexpr int kHalf = kSize / 2;
  EdgeProducts pairs;
  EdgeProducts neighbors;
  EdgeProducts chain;
  EdgeProducts groups;
  for (int i = 0; i < kHalf; ++i) {
    pairs.edges.emplace_back(i, kHalf + i);
    neighbors.edges.emplace_back(2 * i, 2 * i + 1);
    for (int j = kHalf; j < kSize; ++j) groups.edges.emplace_back(i, j);
  }
  for (int i = 0; i + 1 < kSize; ++i) chain.edges.emplace_back(i, i + 1);
  for (const EdgeProducts& products : {pairs, neighbors, chain, groups}) {
    EXPECT_EQ(LinearParameters<kSize>(products, 1, b.data()).size(), kHalf);
  }
}

}  // namespace linear_parameters_test
}  // namespace invgrad
