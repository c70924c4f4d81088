#include "problems/poisson.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "fmt/core.h"
#include "invgrad/chain/linear_simulator.h"
#include "invgrad/chain/loss.h"
#include "invgrad/io/numpy_random.h"

namespace invgrad {

Eigen::SparseMatrix<double, Eigen::RowMajor> Poisson::Laplacian(int n) {
  std::vector<Eigen::Triplet<double>> entries;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const int row = n * i + j;
      entries.emplace_back(row, row, -4.0);
      if (i > 0) entries.emplace_back(row, row - n, 1.0);
      if (i < n - 1) entries.emplace_back(row, row + n, 1.0);
      if (j > 0) entries.emplace_back(row, row - 1, 1.0);
      if (j < n - 1) entries.emplace_back(row, row + 1, 1.0);
    }
  }
  Eigen::SparseMatrix<double, Eigen::RowMajor> A(n * n, n * n);
  A.setFromTriplets(entries.begin(), entries.end());
  return A;
}

Eigen::MatrixXd Poisson::SmoothFields(int num_fields, int n, int seed) {
  // Rows 2 m and 2 m + 1: the contributions of Re z_k and Im z_k for the m-th
  // k.
  const int size = n * n;
  Eigen::MatrixXd modes = Eigen::MatrixXd::Zero(2 * size, size);
  for (int m = 1; m < size; ++m) {  // m = 0: the mean
    const int k_1 = m / n, k_2 = m % n;
    const auto frequency = [n](int k) { return std::min(k, n - k); };
    const double square =
        frequency(k_1) * frequency(k_1) + frequency(k_2) * frequency(k_2);
    for (int cell = 0; cell < size; ++cell) {
      const int turns = (k_1 * (cell / n) + k_2 * (cell % n)) % n;
      const double angle = 2.0 * M_PI * turns / n;
      modes(2 * m, cell) = std::cos(angle) / square;
      modes(2 * m + 1, cell) = -std::sin(angle) / square;
    }
  }
  NumpyRandom random(static_cast<std::uint32_t>(seed));
  Eigen::MatrixXd fields(num_fields, size);
  Eigen::RowVectorXd z(2 * size);
  for (int s = 0; s < num_fields; ++s) {
    for (int m = 0; m < size; ++m) {
      z.segment<2>(2 * m) = random.NormalPair();
    }
    const Eigen::RowVectorXd field = z * modes;
    fields.row(s) = field * (n / field.norm());
  }
  return fields;
}

bool Poisson::Create(const Options& options,
                     const Eigen::MatrixXd* data,
                     LearningProblem* problem,
                     std::string* error) {
  const int n = options.resolution;
  const int size = n * n;
  const auto generate = [&](int num_rows) {
    return SmoothFields(num_rows, n, options.data_seed);
  };
  if (!MakeData({options.num_samples,
                 size,
                 3.0 * size,
                 fmt::format(":resolution={}", n)},
                data,
                generate,
                problem,
                error)) {
    return false;
  }
  const Eigen::SparseMatrix<double, Eigen::RowMajor> A = Laplacian(n);
  DataSet all;
  all.solutions = problem->data.transpose();
  all.inputs = A * all.solutions;
  all.targets = all.inputs;
  SplitSamples(all, 64, problem);
  AddTargetNoise(options.noise, options.data_seed, problem);
  problem->num_epochs = 25;
  problem->model = std::make_shared<Model>(
      DenseNetwork({size, 64, 128, 64, size}, Activation::kTanh),
      std::make_shared<LinearSimulator>(A, Eigen::VectorXd::Zero(size)),
      std::make_shared<SquaredNormLoss>(size, 0.5),
      Reduction::kSum);
  return true;
}

}  // namespace invgrad
