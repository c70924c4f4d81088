// Poisson's equation in a box: the network inverts the Laplacian.
//
//   y = laplace(x),   L = 1/2 |y - y*|^2,   y* = laplace(x_gt)
//   laplace(x)_ij = x_{i-1,j} + x_{i+1,j} + x_{i,j-1} + x_{i,j+1} - 4 x_ij,
//   x = 0 outside the grid
//
// The network maps y* to x.
//
// Discretization: the 5-point stencil, dx = 1, order 2.
// Shapes:  network input, x, y: n^2, n = resolution, entry n i + j for x_ij.
// Data:    smooth random fields, periodic, of mean zero and variance one:
//            x_gt ~ Re sum_k z_k exp(2 pi i k.(i, j) / n) / |k|^2
//          over the wave vectors k != 0, |k_1|, |k_2| <= n / 2, with real and
//          imaginary part of z_k standard normal, then scaled to variance one.
//          This is the distribution of PhiFlow's Noise (its scale cancels,
//          because it multiplies all k) with another stream: numpy's, seeded by
//          data_seed, with two normal numbers for each k_1 and, within it, each
//          k_2, in the order 0, 1, .. n - 1 of the discrete Fourier transform.
//          The release draws a new batch every step. Here N fields are drawn
//          once, and as many again for testing. x_gt is the data's solution.
// Settings: n 8, network 64-64-128-64-64 tanh (24,896 weights), B 64, loss
//          summed over the batch; half-inverse: step size 0.01, truncation
//          1e-5.
// Facts:   x = A^-1 y is linear, so a network without hidden layers could be
//          exact. A is symmetric with the eigenvectors sin(p pi (i+1) / (n+1))
//          sin(q pi (j+1) / (n+1)) and eigenvalues 2 cos(p pi / (n+1)) + 2
//          cos(q pi / (n+1)) - 4, p, q = 1 .. n: condition number 32 at n = 8.
// Source:  Schnell, Holl, Thuerey, ICLR 2022, section 3.3, arXiv 2203.10131,
//          and its code, Poisson_problem/; PhiFlow 2, phi/field/_noise.py.
#ifndef PROBLEMS_POISSON_H_
#define PROBLEMS_POISSON_H_

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "fmt/core.h"
#include "invgrad/compare/sample_data.h"
#include "invgrad/linear_simulator.h"
#include "invgrad/loss.h"
#include "invgrad/random.h"

namespace invgrad {

struct Poisson {
  int resolution = 8;
  int num_samples = 4096;
  int data_seed = 0;
  double noise = 0.0;
  void Describe(OptionSet* set) {
    set->Add("resolution", &resolution, {2, 32}, "cells a side, n");
    DescribeSamples(1, 1e6, &num_samples, &data_seed, set);
    DescribeTargetNoise(&noise, set);
  }

  // A: n^2 x n^2.
  static Eigen::SparseMatrix<double, Eigen::RowMajor> Laplacian(int n) {
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

  // num_fields x n^2.
  static Eigen::MatrixXd SmoothFields(int num_fields, int n, int seed) {
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
    for (int s = 0; s < num_fields; ++s) {
      const Eigen::RowVectorXd z = random.Normal(2 * size).transpose();
      const Eigen::RowVectorXd field = z * modes;
      fields.row(s) = field * (n / field.norm());
    }
    return fields;
  }

  // `data`: fields x_gt, one a row.
  bool Create(LearningProblem* problem, std::string* error) const {
    const int size = resolution * resolution;
    const auto generate = [this](int num_rows) {
      return SmoothFields(num_rows, resolution, data_seed);
    };
    const SampleSize sample_size = {num_samples,
                                    size,
                                    3.0 * size,
                                    fmt::format(":resolution={}", resolution)};
    if (!MakeData(sample_size, generate, problem, error)) return false;
    const Eigen::SparseMatrix<double, Eigen::RowMajor> A =
        Laplacian(resolution);
    DataSet all;
    all.solutions = problem->data.transpose();
    all.inputs = A * all.solutions;
    all.targets = all.inputs;
    SplitSamples(all, 64, problem);
    AddTargetNoise(noise, data_seed, problem);
    problem->num_epochs = 25;
    problem->model = std::make_shared<Model>(
        DenseNetwork({size, 64, 128, 64, size}, Activation::kTanh),
        std::make_shared<LinearSimulator>(A, Eigen::VectorXd::Zero(size)),
        std::make_shared<SquaredNormLoss>(size, 0.5),
        Reduction::kSum);
    return true;
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_POISSON_H_
