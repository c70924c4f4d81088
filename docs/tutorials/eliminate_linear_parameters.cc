// A separable fit in ceres::Solve: two isotopes decay in front of a detector
// with a background. Their rates are searched for; their amplitudes follow.
//
// eliminate_linear_parameters.md explains this program piece by piece.
//
//   eliminate_linear_parameters

#include <array>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/fit_global.h"
#include "invgrad/rank_report.h"
#include "invgrad/separable.h"

namespace {

using invgrad::SeparableProblem;

// [count]
// The count rate at time t [h]: c0 exp(-a0 t) + c1 exp(-a1 t) + c2.
struct Count {
  template <typename T>
  bool operator()(const T* c, const T* a, T* r) const {
    using std::exp;
    r[0] = c[0] * exp(-a[0] * t) + c[1] * exp(-a[1] * t) + c[2] - measured;
    return true;
  }
  double t;
  double measured;
};
// [/count]

// [problem]
struct Decay {
  std::array<double, 3> c = {100.0, 100.0, 100.0};  // amplitudes, background
  std::array<double, 2> a = {1.0, 0.1};             // rates [1/h]
  ceres::Problem problem;

  explicit Decay(ceres::LossFunction* loss = nullptr) {
    for (int i = 0; i < 60; ++i) {
      const double t = 0.1 * i;
      double measured = 40.0 * std::exp(-2.0 * t) + 25.0 * std::exp(-0.5 * t) +
                        3.0 + 0.3 * std::sin(7.0 * i);  // in place of noise
      if (loss != nullptr && i % 20 == 10) measured += 30.0;  // outliers
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Count, 1, 3, 2>(
                                   new Count{t, measured}),
                               loss,
                               c.data(),
                               a.data());
    }
  }

  void Print() const {
    std::printf("rates %.3f %.3f, amplitudes %.2f %.2f, background %.2f\n",
                a[0],
                a[1],
                c[0],
                c[1],
                c[2]);
  }
};
// [/problem]

// [one_block]
// The same with all parameters in one block, b = (c0, a0, c1, a1, c2).
struct CountOfOneBlock {
  template <typename T>
  bool operator()(const T* b, T* r) const {
    const T c[] = {b[0], b[2], b[4]};
    const T a[] = {b[1], b[3]};
    return count(c, a, r);
  }
  Count count;
};
// [/one_block]

// [features]
struct Features {  // for all times: exp(-a0 t), exp(-a1 t), 1
  template <typename T>
  bool operator()(const T* a, T* phi) const {
    using std::exp;
    for (int i = 0; i < 60; ++i) {
      phi[i] = exp(-a[0] * (0.1 * i));
      phi[60 + i] = exp(-a[1] * (0.1 * i));
      phi[120 + i] = T(1.0);
    }
    return true;
  }
};
// [/features]

}  // namespace

int main() {
  // [all]
  ceres::Solver::Options options;
  options.max_num_iterations = 500;
  options.function_tolerance = 1e-12;
  ceres::Solver::Summary summary;
  Decay all;
  ceres::Solve(options, &all.problem, &summary);
  std::printf("all parameters: cost %.2f after %d iterations\n",
              summary.final_cost,
              static_cast<int>(summary.iterations.size()) - 1);
  // [/all]

  // [separable]
  Decay decay;
  std::string error;
  std::unique_ptr<SeparableProblem> separable = SeparableProblem::Create(
      {}, {{decay.c.data(), {}}}, &decay.problem, &error);
  if (separable == nullptr) {
    std::cerr << error << "\n";
    return 1;
  }
  ceres::Solve(options, separable->reduced(), &summary);
  if (!separable->SolveLinear(&error)) {
    std::cerr << error << "\n";
    return 1;
  }
  std::printf("variable projection: cost %.2f\n", summary.final_cost);
  decay.Print();
  std::printf("%d linear parameters, %d of them determined\n\n",
              separable->num_linear(),
              separable->rank());
  // [/separable]

  // [robust]
  Decay robust(new ceres::CauchyLoss(1.0));
  separable = SeparableProblem::Create(
      {}, {{robust.c.data(), {}}}, &robust.problem, &error);
  ceres::Solve(options, separable->reduced(), &summary);
  separable->SolveLinear(&error);
  std::cout << "with outliers: ";
  robust.Print();
  // [/robust]

  // [undetermined]
  Decay equal;
  equal.a = {0.5, 0.5};
  equal.problem.SetParameterBlockConstant(equal.a.data());
  separable = SeparableProblem::Create(
      {}, {{equal.c.data(), {}}}, &equal.problem, &error);
  ceres::Solve(options, separable->reduced(), &summary);
  separable->SolveLinear(&error);
  std::cout << "equal rates: ";
  equal.Print();
  invgrad::RankReport::Options of_rank;
  of_rank.block_name = [](const double* /*values*/) { return "c"; };
  invgrad::RankReport report;
  if (!invgrad::ComputeRankReport(of_rank, equal.problem, &report, &error)) {
    std::cerr << error << "\n";
    return 1;
  }
  std::printf("%d of %d determined; open:", report.rank, report.num_parameters);
  const invgrad::RankReport::Part& part = report.undetermined[0].parts[0];
  for (int i = 0; i < 3; ++i) {
    if (std::abs(part.motion[i]) < 1e-6) continue;
    std::cout << " " << report.blocks[part.block].ParameterName(i);
  }
  std::cout << "\n\n";
  // [/undetermined]

  // [wrong]
  Decay wrong;
  SeparableProblem::Create({},
                           {{wrong.c.data(), {}}, {wrong.a.data(), {0}}},
                           &wrong.problem,
                           &error);
  std::cout << error << "\n\n";
  // [/wrong]

  // [proof]
  const double b[] = {1.0, 2.0, 1.0, 0.5, 1.0};
  std::cout << "linear in b:";
  for (const int i :
       invgrad::LinearParameters<5>(CountOfOneBlock{{1.0, 10.0}}, 1, b)) {
    std::cout << " " << i;
  }
  std::cout << "\n\n";
  // [/proof]

  // [global]
  // 1,000 energies with the same rates: amplitudes 1 ... 50, without noise.
  constexpr int kEnergies = 1000;
  const std::array<double, 2> rates = {2.0, 0.5};
  Eigen::MatrixXd Phi(60, 3);
  Features()(rates.data(), Phi.data());
  Eigen::MatrixXd C(3, kEnergies);
  for (int k = 0; k < kEnergies; ++k) {
    C.col(k) << 1.0 + k % 50, 1.0 + k % 37, 3.0;
  }
  invgrad::GlobalFit<2> fit;
  fit.nonlinear.x << 5.0, 0.05;
  invgrad::FitGlobal(invgrad::FitOptions(), Features(), 3, Phi * C, &fit);
  std::printf(
      "1000 spectra: rates %.3f %.3f, amplitudes of the last one %.2f %.2f\n",
      fit.nonlinear.x[0],
      fit.nonlinear.x[1],
      fit.C(0, kEnergies - 1),
      fit.C(1, kEnergies - 1));
  // [/global]
  return 0;
}
