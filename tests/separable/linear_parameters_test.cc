#include <cmath>
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

}  // namespace linear_parameters_test
}  // namespace invgrad
