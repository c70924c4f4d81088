#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <iostream>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "bin/separable_fits/parts.h"
#include "ceres/autodiff_cost_function.h"
#include "ceres/ordered_groups.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/fit/fit_global.h"
#include "invgrad/io/format.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/separable/separable_problem.h"
#include "report/table.h"

namespace invgrad {
namespace {

using Clock = std::chrono::steady_clock;

const Eigen::Vector3d kRates(0.2, 1.0, 4.0);
const Eigen::Vector3d kStartRates(0.1, 0.8, 6.0);
constexpr double kNoise = 0.01;

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

  GlobalData()
      : t(Eigen::VectorXd::LinSpaced(FLAGS_samples, 0.0, 5.0)),
        Y(FLAGS_samples, FLAGS_sides) {
    NumpyRandom random(1);
    const ThreeDecays decays{t};
    Eigen::MatrixXd Phi(FLAGS_samples, 3);
    decays(kRates.data(), Phi.data());
    for (int k = 0; k < FLAGS_sides; ++k) {
      Y.col(k) =
          Phi * random.Rand(3, 1) + kNoise * random.Normal(FLAGS_samples);
    }
  }
};

// All parameters in one problem.
struct FullProblem {
  Eigen::Vector3d a = kStartRates;
  Eigen::MatrixXd C;
  ceres::Problem problem;

  explicit FullProblem(const GlobalData& data)
      : C(Eigen::MatrixXd::Ones(3, FLAGS_sides)) {
    for (int k = 0; k < FLAGS_sides; ++k) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Side, ceres::DYNAMIC, 3, 3>(
              new Side{{data.t}, data.Y.col(k)}, FLAGS_samples),
          nullptr,
          C.col(k).data(),
          a.data());
    }
  }
};

struct GlobalResult {
  Eigen::Vector3d a;
  double cost = 0.0;
  int num_iterations = 0;
};

using GlobalFunction = std::function<GlobalResult(const GlobalData& data)>;

GlobalResult SolveFull(ceres::LinearSolverType solver,
                       bool is_ordered,
                       const GlobalData& data) {
  FullProblem full(data);
  ceres::Solver::Options options;
  options.linear_solver_type = solver;
  options.logging_type = ceres::SILENT;
  if (is_ordered) {
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (int k = 0; k < FLAGS_sides; ++k) {
      ordering->AddElementToGroup(full.C.col(k).data(), 0);
    }
    ordering->AddElementToGroup(full.a.data(), 1);
    options.linear_solver_ordering = ordering;
  }
  ceres::Solver::Summary summary;
  ceres::Solve(options, &full.problem, &summary);
  return {full.a,
          summary.final_cost,
          static_cast<int>(summary.iterations.size()) - 1};
}

GlobalResult SolveComponents(const GlobalData& data) {
  FullProblem full(data);
  std::vector<LinearBlock> linear;
  linear.reserve(FLAGS_sides);
  for (int k = 0; k < FLAGS_sides; ++k) {
    linear.push_back({full.C.col(k).data(), {}});
  }
  std::string error;
  const auto separable =
      SeparableProblem::Create({}, linear, &full.problem, &error);
  CHECK(separable != nullptr) << error;
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, separable->reduced(), &summary);
  CHECK(separable->SolveLinear(&error)) << error;
  return {full.a,
          summary.final_cost,
          static_cast<int>(summary.iterations.size()) - 1};
}

GlobalResult SolveGlobal(const GlobalData& data) {
  // [fit_global]
  GlobalFit<3> fit;
  fit.nonlinear.x = kStartRates;
  FitGlobal(
      FitOptions(), ThreeDecays{data.t}, /*num_features=*/3, data.Y, &fit);
  // fit.nonlinear.x: the rates;  fit.C: 3 x K
  // [/fit_global]
  return {fit.nonlinear.x, fit.nonlinear.cost, fit.nonlinear.num_iterations};
}

}  // namespace

void CompareGlobalFits(RunCounts* counts) {
  const GlobalData data;
  struct Row {
    std::string name;
    GlobalFunction solve;
    GlobalResult result;
    double seconds = std::numeric_limits<double>::infinity();
  };
  std::vector<Row> rows;
  const auto add = [&rows](const std::string& name, GlobalFunction solve) {
    rows.push_back({name, std::move(solve), {}});
  };
  add("ceres::Solve, default options", [](const GlobalData& all) {
    return SolveFull(ceres::SPARSE_NORMAL_CHOLESKY, false, all);
  });
  add("ceres::Solve, DENSE_SCHUR, amplitudes first", [](const GlobalData& all) {
    return SolveFull(ceres::DENSE_SCHUR, true, all);
  });
  add("SeparableProblem, a component a side", SolveComponents);
  add("FitGlobal", SolveGlobal);
  for (int i = 0; i < FLAGS_repetitions; ++i) {
    for (Row& row : rows) {
      const Clock::time_point start = Clock::now();
      row.result = row.solve(data);
      const std::chrono::duration<double> duration = Clock::now() - start;
      row.seconds = std::min(row.seconds, duration.count());
    }
  }
  const Row& global = rows.back();
  Table table;
  for (const Row& row : rows) {
    counts->Add(std::isfinite(row.result.cost));
    table.BeginRow();
    table.Add(
        fmt::format(
            "{} right-hand sides of {} samples", FLAGS_sides, FLAGS_samples),
        row.name,
        Table::Align::kLeft);
    table.Add("iterations", std::to_string(row.result.num_iterations));
    table.Add("ms", FormatNumber(1e3 * row.seconds, 3));
    table.Add("times FitGlobal", FormatNumber(row.seconds / global.seconds, 3));
    table.Add("cost", FormatNumber(row.result.cost, 8));
    table.Add("difference of a",
              FormatNumber((row.result.a - global.result.a).norm(), 2));
  }
  std::cout << table.ToMarkdown();
}

}  // namespace invgrad
