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

#include <string>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "problems/problem.h"
#include "problems/sample_data.h"

namespace invgrad {

struct Poisson {
  struct Options {
    int resolution = 8;
    int num_samples = 4096;
    int data_seed = 0;
    double noise = 0.0;
    void Describe(OptionSet* set) {
      set->Add("resolution", &resolution, {2, 32}, "cells a side, n");
      DescribeSamples(1, 1e6, &num_samples, &data_seed, set);
      DescribeTargetNoise(&noise, set);
    }
  };

  // `data`: fields x_gt, one a row.
  static bool Create(const Options& options,
                     const Eigen::MatrixXd* data,
                     LearningProblem* problem,
                     std::string* error);

  // A: n^2 x n^2.
  static Eigen::SparseMatrix<double, Eigen::RowMajor> Laplacian(int n);

  // num_fields x n^2.
  static Eigen::MatrixXd SmoothFields(int num_fields, int n, int seed);
};

}  // namespace invgrad

#endif  // PROBLEMS_POISSON_H_
