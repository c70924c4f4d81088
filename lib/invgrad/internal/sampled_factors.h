// Kronecker factors of the layers of a network whose J is given by products, for
// one covector w of the outputs (K-FAC).
//
//   J_l^T (w w^T) J_l ~ A (x) D,   A = 1/N sum_t a_t a_t^T
//   D = sum_t delta_t delta_t^T,   delta_t = d(w . y)/dz_t
//
// A layer is a matrix of weights that is applied to the inputs a_t of all N
// positions t of the batch: one a sample for a dense layer, the patch (channel by
// channel) under the kernel at each cell for a convolution [1]; with a last 1 for
// the bias. Its outputs z_t are one column a position. For random w with the
// covariance H, the means of the factors are those of J_l^T H J_l: all outputs
// at the cost of one backward pass.
//
// Shapes:  w: m;  A: fan_in x fan_in;  D: fan_out x fan_out.
//
// [1] Grosse, Martens. A Kronecker-factored approximate Fisher matrix for
//     convolution layers. ICML 2016, theorem 1. arXiv 1602.01407. There A is a
//     sum and D a mean over the positions of a sample: the same product.
#ifndef INVGRAD_INTERNAL_SAMPLED_FACTORS_H_
#define INVGRAD_INTERNAL_SAMPLED_FACTORS_H_

#include <vector>

#include "Eigen/Core"

namespace invgrad {

// fan_in x fan_out: the column of J of each weight of a layer; the biases, if
// there are any, in the last row.
using LayerColumns = Eigen::MatrixXi;

struct SampledFactors {
  struct Layer {
    Eigen::MatrixXd A;
    Eigen::MatrixXd D;
  };
  std::vector<Layer> layers;
  // J^T w (n) in the columns that belong to no layer, zero in the others.
  Eigen::VectorXd others;
};

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_SAMPLED_FACTORS_H_
