#include "problems/more_garbow_hillstrom.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "ceres/autodiff_cost_function.h"

namespace invgrad {
namespace more_garbow_hillstrom {

// For double; argument-dependent lookup finds the functions for Jets.
using std::abs;
using std::atan2;
using std::exp;
using std::pow;
using std::sqrt;

template <typename T>
T Square(const T& value) {
  return value * value;
}

template <typename Function>
struct Residuals {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    function(x, r);
    return true;
  }
  Function function;
};

// `function` computes m residuals from n unknowns of any scalar type.
template <int m, int n, typename Function>
MoreGarbowHillstromRow Row(const std::string& name,
                           std::vector<double> start,
                           double minimum,
                           Function function) {
  return {
      name,
      std::move(start),
      minimum,
      [function] {
        using Cost = Residuals<Function>;
        return new ceres::AutoDiffCostFunction<Cost, m, n>(new Cost{function});
      },
      {},
      {}};
}

using Rows = std::vector<MoreGarbowHillstromRow>;

// By the number of unknowns.
Rows RowsOf2() {
  return {
      Row<2, 2>("rosenbrock",
                {-1.2, 1},
                0,
                [](const auto* x, auto* r) {
                  r[0] = 10.0 * (x[1] - x[0] * x[0]);
                  r[1] = 1.0 - x[0];
                }),
      Row<2, 2>("freudenstein_roth",
                {0.5, -2},
                0,
                [](const auto* x, auto* r) {
                  r[0] = -13.0 + x[0] + ((5.0 - x[1]) * x[1] - 2.0) * x[1];
                  r[1] = -29.0 + x[0] + ((x[1] + 1.0) * x[1] - 14.0) * x[1];
                }),
      Row<2, 2>("powell_badly_scaled",
                {0, 1},
                0,
                [](const auto* x, auto* r) {
                  r[0] = 1e4 * x[0] * x[1] - 1.0;
                  r[1] = exp(-x[0]) + exp(-x[1]) - 1.0001;
                }),
      Row<3, 2>("brown_badly_scaled",
                {1, 1},
                0,
                [](const auto* x, auto* r) {
                  r[0] = x[0] - 1e6;
                  r[1] = x[1] - 2e-6;
                  r[2] = x[0] * x[1] - 2.0;
                }),
      Row<3, 2>("beale",
                {1, 1},
                0,
                [](const auto* x, auto* r) {
                  r[0] = 1.5 - x[0] * (1.0 - x[1]);
                  r[1] = 2.25 - x[0] * (1.0 - x[1] * x[1]);
                  r[2] = 2.625 - x[0] * (1.0 - x[1] * x[1] * x[1]);
                }),
      Row<10, 2>("jennrich_sampson",
                 {0.3, 0.4},
                 124.362,
                 [](const auto* x, auto* r) {
                   for (int i = 1; i <= 10; ++i)
                     r[i - 1] = 2.0 + 2.0 * i -
                                (exp(static_cast<double>(i) * x[0]) +
                                 exp(static_cast<double>(i) * x[1]));
                 }),
  };
}

// Measured values of [1].
constexpr double kBard[] = {.14,
                            .18,
                            .22,
                            .25,
                            .29,
                            .32,
                            .35,
                            .39,
                            .37,
                            .58,
                            .73,
                            .96,
                            1.34,
                            2.10,
                            4.39};
constexpr double kGaussian[] = {.0009,
                                .0044,
                                .0175,
                                .0540,
                                .1295,
                                .2420,
                                .3521,
                                .3989};  // then the first seven backwards
constexpr double kMeyer[] = {34780,
                             28610,
                             23650,
                             19630,
                             16370,
                             13720,
                             11540,
                             9744,
                             8261,
                             7030,
                             6005,
                             5147,
                             4427,
                             3820,
                             3307,
                             2872};

Rows RowsOf3() {
  return {
      Row<3, 3>("helical_valley",
                {-1, 0, 0},
                0,
                [](const auto* x, auto* r) {
                  auto th = atan2(x[1], x[0]) / (2 * M_PI);
                  if (th < -0.25) th += 1.0;  // in (-1/4, 3/4)
                  r[0] = 10.0 * (x[2] - 10.0 * th);
                  r[1] = 10.0 * (sqrt(x[0] * x[0] + x[1] * x[1]) - 1.0);
                  r[2] = x[2];
                }),
      Row<15, 3>("bard",
                 {1, 1, 1},
                 8.21487e-3,
                 [](const auto* x, auto* r) {
                   for (int i = 1; i <= 15; ++i) {
                     const double u = i, v = 16 - i, w = std::min(u, v);
                     r[i - 1] =
                         kBard[i - 1] - (x[0] + u / (v * x[1] + w * x[2]));
                   }
                 }),
      Row<15, 3>("gaussian",
                 {.4, 1, 0},
                 1.12793e-8,
                 [](const auto* x, auto* r) {
                   for (int i = 1; i <= 15; ++i) {
                     const double t = (8.0 - i) / 2.0;
                     r[i - 1] = x[0] * exp(-0.5 * x[1] * Square(t - x[2])) -
                                kGaussian[std::min(i, 16 - i) - 1];
                   }
                 }),
      Row<16, 3>("meyer",
                 {.02, 4000, 250},
                 87.9458,
                 [](const auto* x, auto* r) {
                   for (int i = 1; i <= 16; ++i)
                     r[i - 1] = x[0] * exp(x[1] / (45.0 + 5.0 * i + x[2])) -
                                kMeyer[i - 1];
                 }),
      Row<100, 3>("gulf",
                  {5, 2.5, .15},
                  0,
                  [](const auto* x, auto* r) {
                    for (int i = 1; i <= 100; ++i) {
                      const double t = i / 101.0,
                                   y = 25.0 +
                                       pow(-50.0 * std::log(t), 2.0 / 3.0);
                      r[i - 1] = exp(-pow(abs(y - x[1]), x[2]) / x[0]) - t;
                    }
                  }),
      Row<10, 3>("box_3d",
                 {0, 10, 20},
                 0,
                 [](const auto* x, auto* r) {
                   for (int i = 1; i <= 10; ++i) {
                     const double t = 0.1 * i;
                     r[i - 1] = exp(-t * x[0]) - exp(-t * x[1]) -
                                x[2] * (exp(-t) - exp(-10.0 * t));
                   }
                 }),
  };
}

Rows RowsOf4() {
  return {
      Row<4, 4>("powell_singular",
                {3, -1, 0, 1},
                0,
                [](const auto* x, auto* r) {
                  r[0] = x[0] + 10.0 * x[1];
                  r[1] = sqrt(5.0) * (x[2] - x[3]);
                  r[2] = Square(x[1] - 2.0 * x[2]);
                  r[3] = sqrt(10.0) * Square(x[0] - x[3]);
                }),
      Row<6, 4>("wood",
                {-3, -1, -3, -1},
                0,
                [](const auto* x, auto* r) {
                  r[0] = 10.0 * (x[1] - x[0] * x[0]);
                  r[1] = 1.0 - x[0];
                  r[2] = sqrt(90.0) * (x[3] - x[2] * x[2]);
                  r[3] = 1.0 - x[2];
                  r[4] = sqrt(10.0) * (x[1] + x[3] - 2.0);
                  r[5] = (x[1] - x[3]) / sqrt(10.0);
                }),
      Row<11, 4>(
          "kowalik_osborne",
          {.25, .39, .415, .39},
          3.07505e-4,
          [](const auto* x, auto* r) {
            const double
                y[] = {.1957,
                       .1947,
                       .1735,
                       .1600,
                       .0844,
                       .0627,
                       .0456,
                       .0342,
                       .0323,
                       .0235,
                       .0246},
                u[] = {4, 2, 1, .5, .25, .167, .125, .1, .0833, .0714, .0625};
            for (int i = 0; i < 11; ++i)
              r[i] = y[i] - x[0] * (u[i] * u[i] + u[i] * x[1]) /
                                (u[i] * u[i] + u[i] * x[2] + x[3]);
          }),
      Row<20, 4>("brown_dennis",
                 {25, 5, -5, -1},
                 85822.2,
                 [](const auto* x, auto* r) {
                   for (int i = 1; i <= 20; ++i) {
                     const double t = i / 5.0;
                     auto a = x[0] + t * x[1] - exp(t);
                     auto b = x[2] + x[3] * std::sin(t) - std::cos(t);
                     r[i - 1] = Square(a) + Square(b);
                   }
                 }),
  };
}

Rows RowsOfMore() {
  return {
      Row<33, 5>("osborne_1",
                 {.5, 1.5, -1, .01, .02},
                 5.46489e-5,
                 [](const auto* x, auto* r) {
                   const double y[] = {.844, .908, .932, .936, .925, .908, .881,
                                       .850, .818, .784, .751, .718, .685, .658,
                                       .628, .603, .580, .558, .538, .522, .506,
                                       .490, .478, .467, .457, .448, .438, .431,
                                       .424, .420, .414, .411, .406};
                   for (int i = 0; i < 33; ++i) {
                     const double t = 10.0 * i;
                     r[i] = y[i] - (x[0] + x[1] * exp(-t * x[3]) +
                                    x[2] * exp(-t * x[4]));
                   }
                 }),
      Row<13, 6>("biggs_exp6",
                 {1, 2, 1, 1, 1, 1},
                 0,
                 [](const auto* x, auto* r) {
                   for (int i = 1; i <= 13; ++i) {
                     const double t = 0.1 * i, y = exp(-t) - 5 * exp(-10 * t) +
                                                   3 * exp(-4 * t);
                     r[i - 1] = x[2] * exp(-t * x[0]) - x[3] * exp(-t * x[1]) +
                                x[5] * exp(-t * x[4]) - y;
                   }
                 }),
      Row<65, 11>(
          "osborne_2",
          {1.3, .65, .65, .7, .6, 3, 5, 7, 2, 4.5, 5.5},
          4.01377e-2,
          [](const auto* x, auto* r) {
            const double y[] = {
                1.366, 1.191, 1.112, 1.013, .991, .885, .831, .847, .786, .725,
                .746,  .679,  .608,  .655,  .616, .606, .602, .626, .651, .724,
                .649,  .649,  .694,  .644,  .624, .661, .612, .558, .533, .495,
                .500,  .423,  .395,  .375,  .372, .391, .396, .405, .428, .429,
                .523,  .562,  .607,  .653,  .672, .708, .633, .668, .645, .632,
                .591,  .559,  .597,  .625,  .739, .710, .729, .720, .636, .581,
                .428,  .292,  .162,  .098,  .054};
            for (int i = 0; i < 65; ++i) {
              const double t = i / 10.0;
              r[i] = y[i] - (x[0] * exp(-t * x[4]) +
                             x[1] * exp(-Square(t - x[8]) * x[5]) +
                             x[2] * exp(-Square(t - x[9]) * x[6]) +
                             x[3] * exp(-Square(t - x[10]) * x[7]));
            }
          }),
  };
}

Rows MakeRows() {
  Rows rows;
  for (const Rows& part : {RowsOf2(), RowsOf3(), RowsOf4(), RowsOfMore()}) {
    rows.insert(rows.end(), part.begin(), part.end());
  }
  return rows;
}

// [2]
struct BoundsRow {
  std::string name;
  std::vector<double> lower, upper;
  double minimum;  // within the bounds
};

Rows MakeBoundedRows() {
  const BoundsRow bounds[] = {
      {"powell_badly_scaled", {0, 1}, {1, 9}, 0.15125900e-9},
      {"brown_badly_scaled", {0, 3e-5}, {1e6, 100}, 0.784e3},
      {"beale", {0.6, 0.5}, {10, 100}, 0},
      {"helical_valley", {-100, -1, -1}, {0.8, 1, 1}, 0.99042212},
      {"gaussian", {0.398, 1, -0.5}, {4.2, 2, 0.1}, 0.112793e-7},
      {"gulf", {1e-16, 0, 0}, {10, 10, 10}, 0.58281431e-4},
      {"box_3d", {0, 5, 0}, {2, 9.5, 20}, 0.30998153e-5},
      {"wood", {-100, -100, -100, -100}, {0, 10, 100, 100}, 0.15567008e1},
      {"brown_dennis", {-10, 0, -100, -20}, {100, 15, 0, 0.2}, 0.88860479e5},
      {"biggs_exp6", {0, 0, 0, 1, 0, 0}, {2, 8, 1, 7, 5, 5}, 0.53209865e-3},
  };
  Rows rows;
  for (const MoreGarbowHillstromRow& row : MoreGarbowHillstrom()) {
    for (const BoundsRow& bound : bounds) {
      if (bound.name != row.name) continue;
      rows.push_back(row);
      rows.back().minimum = bound.minimum;
      rows.back().lower = bound.lower;
      rows.back().upper = bound.upper;
    }
  }
  return rows;
}

}  // namespace more_garbow_hillstrom

const std::vector<MoreGarbowHillstromRow>& MoreGarbowHillstrom() {
  static const auto& rows = *new auto(more_garbow_hillstrom::MakeRows());
  return rows;
}

const std::vector<MoreGarbowHillstromRow>& BoundedMoreGarbowHillstrom() {
  static const auto& rows = *new auto(more_garbow_hillstrom::MakeBoundedRows());
  return rows;
}

std::unique_ptr<ceres::Problem> MakeMoreGarbowHillstrom(
    const MoreGarbowHillstromRow& row, std::vector<double>* x) {
  auto problem = std::make_unique<ceres::Problem>();
  problem->AddResidualBlock(row.make_cost(), nullptr, x->data());
  for (int i = 0; i < static_cast<int>(row.lower.size()); ++i) {
    problem->SetParameterLowerBound(x->data(), i, row.lower[i]);
    problem->SetParameterUpperBound(x->data(), i, row.upper[i]);
  }
  return problem;
}

double SumOfSquares(ceres::Problem* problem) {
  double cost = 0.0;
  problem->Evaluate({}, &cost, nullptr, nullptr, nullptr);
  return 2.0 * cost;
}

bool IsSolution(const MoreGarbowHillstromRow& row, double sum_of_squares) {
  return row.minimum > 0.0 ? sum_of_squares < (1.0 + 1e-4) * row.minimum
                           : sum_of_squares < 1e-8;
}

}  // namespace invgrad
