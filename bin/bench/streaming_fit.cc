// fits/streaming/METHOD: one fit of five sines, 10 parameters, to 1,000,000
// points (fit_streaming_10: to ten times as many).
//
//   fit_streaming   FitStreaming
//   ceres_blocks    ceres::Solve, DENSE_NORMAL_CHOLESKY, blocks of 50 points
//   ceres_rows      the same, a block for each point
//
// With a filter for one of them, the peak memory is that of the fit and 4 bytes
// a point.
//
// fits/factor/METHOD: a Gauss-Newton step of 10,000 rows and 10 columns that
// agree but for 1e-4.
//
//   root       by the triangular factor of streaming_gram.h
//   products   by J^T J and J^T r
//
// The label is the largest error of the step.

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "Eigen/Cholesky"
#include "Eigen/Core"
#include "benchmark/benchmark.h"
#include "bin/bench/bench.h"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "fmt/core.h"
#include "invgrad/fit.h"
#include "invgrad/internal/streaming_gram.h"

namespace invgrad {
namespace {

constexpr int kParameters = 10;
using SinesState = Eigen::Matrix<double, kParameters, 1>;

// In [0, 2 pi), whatever the number of rows.
double Time(int i) {
  constexpr double kGolden = 0.61803398874989485;
  return 6.283185307179586 * (kGolden * i - std::floor(kGolden * i));
}

// [sines]
// y = sum of a sin(w t), with amplitudes a and frequencies w unknown.
struct Sines {
  const float* y;

  template <typename T>
  bool operator()(int i, const T* x, T* residual) const {
    using std::sin;
    *residual = T(-y[i]);
    for (int j = 0; j < kParameters; j += 2) {
      *residual += x[j] * sin(x[j + 1] * Time(i));
    }
    return true;
  }
};
// [/sines]

SinesState TrueSines() {
  SinesState x;
  x << 1.0, 1.0, 0.8, 2.1, 0.6, 3.3, 0.5, 4.2, 0.3, 5.4;
  return x;
}

// With an error of +-0.1 that looks random.
std::vector<float> SinesData(int num_rows) {
  const SinesState x = TrueSines();
  std::vector<float> y(num_rows, 0.0F);
  for (int i = 0; i < num_rows; ++i) {
    double value;
    Sines{y.data()}(i, x.data(), &value);
    uint32_t bits = static_cast<uint32_t>(i) * 2654435761U;
    bits = (bits ^ (bits >> 15)) * 2246822519U;
    y[i] = static_cast<float>(value + (bits >> 31 != 0 ? 0.1 : -0.1));
  }
  return y;
}

template <int kRows>
struct SinesBlock {
  Sines sines;
  int begin;

  template <typename T>
  bool operator()(const T* x, T* residuals) const {
    for (int i = 0; i < kRows; ++i) sines(begin + i, x, &residuals[i]);
    return true;
  }
};

void FitSines(int num_rows, Sines sines, SinesState* x) {
  // [fit_streaming]
  FitResult<kParameters> fit;
  fit.x = *x;
  FitStreaming(FitOptions(), num_rows, sines, &fit);
  // [/fit_streaming]
  *x = fit.x;
}

template <int kRows>
void SolveSines(int num_rows, Sines sines, SinesState* x) {
  ceres::Problem problem;
  for (int begin = 0; begin + kRows <= num_rows; begin += kRows) {
    using Block = SinesBlock<kRows>;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Block, kRows, kParameters>(
            new Block{sines, begin}),
        nullptr,
        x->data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
}

using SinesFit = void (*)(int num_rows, Sines sines, SinesState* x);

void AddSines(const std::string& method, int num_rows, SinesFit fit) {
  const std::string reference = "fits/streaming/fit_streaming";
  const std::string name = "fits/streaming/" + method;
  AddBenchmark(
      name, name == reference ? "" : reference, [=](benchmark::State& state) {
        const std::vector<float> y = SinesData(num_rows);
        SinesState x;
        for (auto _ : state) {
          x = TrueSines().array() + 0.05;
          fit(num_rows, {y.data()}, &x);
        }
        state.SetLabel(fmt::format("error of x {:.0e}",
                                   (x - TrueSines()).cwiseAbs().maxCoeff()));
      });
}

constexpr int kFactorRows = 10000;
using FactorRows = Eigen::Matrix<double, kParameters, Eigen::Dynamic>;

SinesState StepByRoot(const FactorRows& J_transposed,
                      const Eigen::VectorXd& r) {
  // [gram]
  StreamingGram<kParameters> gram;
  for (int i = 0; i < r.size(); ++i) {
    gram.AddRow(J_transposed.col(i).data(), r[i]);
  }
  const GramRoot<kParameters>& root = gram.Finish();
  return -root.R.triangularView<Eigen::Upper>().solve(root.c);
  // [/gram]
}

SinesState StepByProducts(const FactorRows& J_transposed,
                          const Eigen::VectorXd& r) {
  using Matrix = Eigen::Matrix<double, kParameters, kParameters>;
  Matrix JtJ = Matrix::Zero();
  SinesState gradient = SinesState::Zero();
  for (int i = 0; i < r.size(); ++i) {
    const SinesState row = J_transposed.col(i);
    JtJ += row * row.transpose();
    gradient += row * r[i];
  }
  return -JtJ.ldlt().solve(gradient);
}

// Columns 1 + e cos(pi j (i + 1/2) / rows); the step is one everywhere.
void MeasureFactor(SinesState (*step_by)(const FactorRows&,
                                         const Eigen::VectorXd&),
                   benchmark::State* state) {
  constexpr double kPi = 3.14159265358979323846;
  constexpr double kDifference = 1e-4;
  const FactorRows J_transposed = FactorRows::NullaryExpr(
      kParameters, kFactorRows, [](Eigen::Index j, Eigen::Index i) {
        const double angle = kPi * static_cast<double>(j) *
                             (static_cast<double>(i) + 0.5) / kFactorRows;
        return 1.0 + kDifference * std::cos(angle);
      });
  const Eigen::VectorXd r = -J_transposed.colwise().sum();
  SinesState step = SinesState::Zero();
  for (auto _ : *state) step = step_by(J_transposed, r);
  state->SetLabel(fmt::format("error of the step {:.0e}",
                              (step.array() - 1.0).abs().maxCoeff()));
}

}  // namespace

bool AddStreamingFitBenchmarks(std::string* /*error*/) {
  constexpr int kRows = 1000000;
  AddSines("fit_streaming", kRows, FitSines);
  AddSines("fit_streaming_10", 10 * kRows, FitSines);
  AddSines("ceres_blocks", kRows, SolveSines<50>);
  AddSines("ceres_rows", kRows, SolveSines<1>);
  AddBenchmark("fits/factor/root", "", [](auto& state) {
    MeasureFactor(StepByRoot, &state);
  });
  AddBenchmark("fits/factor/products", "fits/factor/root", [](auto& state) {
    MeasureFactor(StepByProducts, &state);
  });
  return true;
}

}  // namespace invgrad
