// determined/METHOD: the step for 6 unknowns that leaves undetermined
// directions alone, beside Eigen's decompositions of the same 6 x 6 matrix
// (docs/results/registration.md).
//
//   determined     invgrad::DeterminedStep, groups {3, 3}, all determined
//   corridor       the same, with one direction left alone by the hysteresis
//   ldlt           H.ldlt().solve(gradient), which knows no rank
//   eigen          Eigen::SelfAdjointEigenSolver of H, and the solution
//   jacobi_svd     Eigen::JacobiSVD of H with both factors, and the solution
//   dynamic_svd    the same of a matrix whose size the compiler does not know
//   gram           H = J^T J of 1,000 rows, which comes before each step

#include <string>

#include "Eigen/Cholesky"
#include "Eigen/Core"
#include "Eigen/Eigenvalues"
#include "Eigen/SVD"
#include "benchmark/benchmark.h"
#include "bin/bench/bench.h"
#include "glog/logging.h"
#include "invgrad/determined_step.h"
#include "invgrad/random.h"

namespace invgrad {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

using Jacobian = Eigen::Matrix<double, Eigen::Dynamic, 6>;

Jacobian Rows(int num_rows) {
  return NumpyGenerator(1).StandardNormal(num_rows, 6);
}

// H of 500 random rows, whose first column has the factor `along`.
Matrix6d GramOf(double along) {
  Jacobian J = Rows(500);
  J.col(0) *= along;
  return J.transpose() * J;
}

template <typename Step>
void Add(const std::string& name, const Matrix6d& H, Step step) {
  const std::string reference = "determined/determined";
  AddBenchmark("determined/" + name,
               name == "determined" ? "" : reference,
               [H, step](benchmark::State& state) mutable {
                 Matrix6d matrix = H;
                 Vector6d gradient = Vector6d::LinSpaced(1.0, 2.0);
                 for (auto _ : state) {
                   benchmark::DoNotOptimize(matrix.data());
                   benchmark::DoNotOptimize(gradient.data());
                   benchmark::ClobberMemory();
                   Vector6d x = step(matrix, gradient);
                   benchmark::DoNotOptimize(x.data());
                 }
               })
      ->Unit(benchmark::kMicrosecond);
}

DeterminedStep MakeStep() {
  DeterminedStepOptions options;
  options.group_sizes = {3, 3};
  return DeterminedStep(options);
}

Vector6d StepOf(DeterminedStep* determined,
                const Matrix6d& H,
                const Vector6d& gradient) {
  DeterminedStep::Vector step;
  std::string error;
  CHECK(determined->Compute(H, gradient, &step, &error)) << error;
  return step;
}

}  // namespace

bool AddDeterminedStepBenchmarks(std::string* /*error*/) {
  const Matrix6d full = GramOf(1.0);
  const auto determined = [step = MakeStep()](const auto& H,
                                              const auto& g) mutable {
    return StepOf(&step, H, g);
  };
  Add("determined", full, determined);
  DeterminedStep in_corridor = MakeStep();
  StepOf(&in_corridor, GramOf(0.01), Vector6d::Zero());
  Add("corridor",
      GramOf(0.12),
      [in_corridor](const auto& H, const auto& g) mutable {
        Vector6d step = StepOf(&in_corridor, H, g);
        CHECK_EQ(in_corridor.num_left_alone(), 1);
        return step;
      });
  Add("ldlt", full, [](const auto& H, const auto& g) -> Vector6d {
    return -H.ldlt().solve(g);
  });
  Add("eigen", full, [](const auto& H, const auto& g) -> Vector6d {
    const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(H);
    const Vector6d c = eigen.eigenvectors().transpose() * g;
    return -eigen.eigenvectors() * c.cwiseQuotient(eigen.eigenvalues());
  });
  Add("jacobi_svd", full, [](const auto& H, const auto& g) -> Vector6d {
    return -H.jacobiSvd(Eigen::ComputeFullU | Eigen::ComputeFullV).solve(g);
  });
  Add("dynamic_svd", full, [](const auto& H, const auto& g) -> Vector6d {
    const Eigen::MatrixXd matrix = H;
    return -matrix.jacobiSvd(Eigen::ComputeFullU | Eigen::ComputeFullV)
                .solve(g);
  });
  Add("gram",
      full,
      [J = Rows(1000)](const auto&, const auto&) mutable -> Vector6d {
        benchmark::DoNotOptimize(J.data());
        const Matrix6d H = J.transpose() * J;
        return H.col(0);
      });
  return true;
}

}  // namespace invgrad
