// fits/global_SIDES/METHOD: many right-hand sides, sums of three decays with
// common rates, 100 samples each; with the construction of the problems.
//
//   fit_global     FitGlobal
//   ceres          one ceres::Problem of all parameters, default options
//   ceres_schur    the same, DENSE_SCHUR with the amplitudes first
//   separable      SeparableProblem, a component for each side

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "benchmark/benchmark.h"
#include "bin/bench/bench.h"
#include "ceres/autodiff_cost_function.h"
#include "ceres/ordered_groups.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/fit_global.h"
#include "invgrad/random.h"
#include "invgrad/separable.h"

namespace invgrad {
namespace {

const Eigen::Vector3d kRates(0.2, 1.0, 4.0);
const Eigen::Vector3d kStartRates(0.1, 0.8, 6.0);
constexpr double kGlobalNoise = 0.01;
constexpr int kGlobalSamples = 100;  // of a right-hand side

// [features]
// Columns of Phi: exp(-a_j t), for three decays.
struct ThreeDecays {
  const Eigen::VectorXd& t;

  template <typename T>
  bool operator()(const T* a, T* phi) const {
    using std::exp;
    for (int j = 0; j < 3; ++j) {
      for (Eigen::Index i = 0; i < t.size(); ++i) *phi++ = exp(-a[j] * t[i]);
    }
    return true;
  }
};
// [/features]

// The samples of a right-hand side, for a ceres::Problem.
struct Side {
  ThreeDecays decays;
  Eigen::VectorXd y;

  template <typename T>
  bool operator()(const T* c, const T* a, T* r) const {
    std::vector<T> phi(3 * y.size());
    decays(a, phi.data());
    for (Eigen::Index i = 0; i < y.size(); ++i) {
      r[i] = c[0] * phi[i] + c[1] * phi[y.size() + i] +
             c[2] * phi[2 * y.size() + i] - y[i];
    }
    return true;
  }
};

struct GlobalData {
  Eigen::VectorXd t;
  Eigen::MatrixXd Y;

  explicit GlobalData(int num_sides)
      : t(Eigen::VectorXd::LinSpaced(kGlobalSamples, 0.0, 5.0)),
        Y(kGlobalSamples, num_sides) {
    NumpyRandom random(1);
    const ThreeDecays decays{t};
    Eigen::MatrixXd Phi(kGlobalSamples, 3);
    decays(kRates.data(), Phi.data());
    for (int k = 0; k < num_sides; ++k) {
      Y.col(k) = Phi * random.Rand(3, 1) +
                 kGlobalNoise * random.Normal(kGlobalSamples);
    }
  }
};

// All parameters in one problem.
struct FullProblem {
  Eigen::Vector3d a = kStartRates;
  Eigen::MatrixXd C;
  ceres::Problem problem;

  explicit FullProblem(const GlobalData& data)
      : C(Eigen::MatrixXd::Ones(3, data.Y.cols())) {
    for (Eigen::Index k = 0; k < C.cols(); ++k) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Side, ceres::DYNAMIC, 3, 3>(
              new Side{{data.t}, data.Y.col(k)}, kGlobalSamples),
          nullptr,
          C.col(k).data(),
          a.data());
    }
  }
};

// The number of iterations.
using SolveSides = int (*)(const GlobalData& data);

int Solve(const ceres::Solver::Options& chosen, ceres::Problem* problem) {
  ceres::Solver::Options options = chosen;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, problem, &summary);
  return static_cast<int>(summary.iterations.size()) - 1;
}

int SolveFull(const GlobalData& data) {
  FullProblem full(data);
  return Solve({}, &full.problem);
}

int SolveFullBySchur(const GlobalData& data) {
  FullProblem full(data);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (Eigen::Index k = 0; k < full.C.cols(); ++k) {
    ordering->AddElementToGroup(full.C.col(k).data(), 0);
  }
  ordering->AddElementToGroup(full.a.data(), 1);
  options.linear_solver_ordering = ordering;
  return Solve(options, &full.problem);
}

int SolveComponents(const GlobalData& data) {
  FullProblem full(data);
  std::vector<LinearBlock> linear;
  linear.reserve(full.C.cols());
  for (Eigen::Index k = 0; k < full.C.cols(); ++k) {
    linear.push_back({full.C.col(k).data(), {}});
  }
  std::string error;
  const auto separable =
      SeparableProblem::Create({}, linear, &full.problem, &error);
  CHECK(separable != nullptr) << error;
  const int num_iterations = Solve({}, separable->reduced());
  CHECK(separable->SolveLinear(&error)) << error;
  return num_iterations;
}

int SolveGlobal(const GlobalData& data) {
  // [fit_global]
  GlobalFit<3> fit;
  fit.nonlinear.x = kStartRates;
  FitGlobal(
      FitOptions(), ThreeDecays{data.t}, /*num_features=*/3, data.Y, &fit);
  // fit.nonlinear.x: the rates;  fit.C: 3 x K
  // [/fit_global]
  return fit.nonlinear.num_iterations;
}

}  // namespace

bool AddGlobalFitBenchmarks(std::string* /*error*/) {
  for (const int num_sides : {1000, 10000}) {
    const std::string prefix = fmt::format("fits/global_{}/", num_sides);
    const auto add = [&](const std::string& method, SolveSides solve) {
      AddBenchmark(prefix + method,
                   method == "fit_global" ? "" : prefix + "fit_global",
                   [=](benchmark::State& state) {
                     const GlobalData data(num_sides);
                     for (auto _ : state) {
                       state.counters["iterations"] = solve(data);
                     }
                   });
    };
    add("fit_global", SolveGlobal);
    add("ceres", SolveFull);
    add("ceres_schur", SolveFullBySchur);
    add("separable", SolveComponents);
  }
  return true;
}

}  // namespace invgrad
