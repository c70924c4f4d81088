// The inverse problem of Poisson's equation: from the smooth solution to its
// rough source.
//
//   y = P(x) = A^-1 x,   L = 1/2 |y - y*|^2,   y* = P(x_gt)
//
// with the 5-point Laplacian A of poisson.h, dx = 1, zero outside the grid. The
// network maps y* to x. (In `poisson` P is A, and the network inverts it.)
//
// Discretization: exact for A, by the sine transform (fields/sine_grid.h).
// Shapes:  network input, x, y: n^2, n = resolution, entry n i + j for x_ij.
// Inverse: x = A y, exact: the simulator is linear (Simulator::InversePower).
// Metric:  x_l1 = mean |x - x_gt|. L is insensitive to the fine modes of x.
// Data:    the fields of `poisson`, periodic, without the coarsest modes, k^2 <=
//          0.1 for k = 10 m / n with m waves across the box: at n = 64 those
//          with |m|^2 < 5, below n = 32 the mean only. Of mean zero and
//          variance one. Stream as `poisson`; the release draws a new batch
//          every step, as fresh_data does here (field_data.h). By default N
//          fields are drawn once, and as many again for testing. x_gt is the data's solution.
// Settings: B 128, loss summed over the batch, Adam and SIP with step size 1e-3
//          for 7 h. Published is a U-net at n = 64 (network=u_net), here in
//          single precision with the physics in double. By default a dense
//          network with ReLU, n^2-128-128-n^2.
// Facts:   the eigenvalues of P are 1 / lambda_pq, all negative; its condition
//          number is 116 at n = 16 and 1,712 at n = 64, so y changes with x by
//          factors that vary that much, and the squares of them scale the
//          gradient in x. P is linear: x~ of SIP is x_gt, and SIP is the same as
//          supervised training.
// Source:  Holl, Koltun, Thuerey, NeurIPS 2022, arXiv 2109.15048, and its code,
//          poisson/train_poisson.py; PhiFlow 2, phi/field/_noise.py.
#ifndef PROBLEMS_POISSON_INVERSE_H_
#define PROBLEMS_POISSON_INVERSE_H_

#include <cstdint>
#include <string>

#include "Eigen/Core"
#include "invgrad/compare/sample_data.h"
#include "problems/field_data.h"
#include "problems/fields/diagonal_simulator.h"
#include "problems/fields/sine_grid.h"

namespace invgrad {

// y = A^-1 x.
class InverseLaplacian final : public DiagonalSimulator {
 public:
  explicit InverseLaplacian(const SineGrid& grid);

 private:
  void Filter(const Eigen::ArrayXd& factors,
              const double* x,
              double* y) const override;

  SineGrid grid_;
};

struct PoissonInverse {
  int resolution = 16;
  int num_samples = 4096;
  int data_seed = 0;
  FieldNetwork field;
  void Describe(OptionSet* set) {
    set->Add("resolution", &resolution, {2, 128}, "cells a side, n");
    DescribeSamples(1, 1e6, &num_samples, &data_seed, set);
    field.Describe(set);
  }

  // num_fields x n^2.
  static Eigen::MatrixXd RandomSources(int num_fields,
                                       int n,
                                       std::uint32_t seed);

  // `data`: fields x_gt, one a row.
  bool Create(LearningProblem* problem, std::string* error) const;
};

}  // namespace invgrad

#endif  // PROBLEMS_POISSON_INVERSE_H_
