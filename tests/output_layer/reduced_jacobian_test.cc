#include "invgrad/output_layer/reduced_jacobian.h"

#include <memory>
#include <utility>
#include <vector>

#include "Eigen/Dense"
#include "gtest/gtest.h"
#include "invgrad/chain/network_jacobian.h"
#include "invgrad/internal/qr.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/stored_jacobian.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace reduced_jacobian_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kRows = 7;

const std::vector<int>& Others() {
  static const auto* const others = new std::vector<int>{0, 2, 3, 5};
  return *others;
}

MatrixXd Basis() { return Orthonormalized(RandomMatrix(kRows, 2, 3)); }

TEST(ReducedJacobian, IsTheProjectedPartOfJ) {
  const MatrixXd dense = RandomMatrix(kRows, 6, 1);
  for (const MatrixXd& Q : {MatrixXd(), Basis()}) {
    MatrixXd expected = dense(Eigen::all, Others());
    if (Q.size() > 0) expected -= Q * (Q.transpose() * expected);
    const ReducedJacobian J(
        std::make_shared<DenseJacobian>(dense), Others(), Q);
    ASSERT_EQ(J.rows(), kRows);
    ASSERT_EQ(J.cols(), 4);
    MatrixXd found;
    J.ToDense(&found);
    EXPECT_LT((found - expected).norm(), 1e-14);
    const VectorXd v = RandomMatrix(4, 1, 4);
    const VectorXd w = RandomMatrix(kRows, 1, 5);
    VectorXd product;
    J.Times(v, &product);
    EXPECT_LT((product - expected * v).norm(), 1e-14);
    J.TransposeTimes(w, &product);
    EXPECT_LT((product - expected.transpose() * w).norm(), 1e-14);
    J.Gram(&found);
    EXPECT_LT(MatrixXd((found - expected * expected.transpose())
                           .triangularView<Eigen::Lower>())
                  .norm(),
              1e-13);
    J.ParameterGram(&found);
    EXPECT_LT(MatrixXd((found - expected.transpose() * expected)
                           .triangularView<Eigen::Lower>())
                  .norm(),
              1e-13);
    EXPECT_EQ(J.RowName(3), DenseJacobian(dense).RowName(3));
  }
}

// The layers but the last one, of a network.
TEST(ReducedJacobian, OfANetworkHasTheOtherLayers) {
  const DenseNetwork network({3, 4, 5, 2}, Activation::kTanh);
  const VectorXd weights = RandomMatrix(network.num_weights(), 1, 6);
  DenseNetwork::Activations activations;
  network.Forward(weights, RandomMatrix(3, 6, 7), false, &activations);
  const auto J = std::make_shared<NetworkJacobian>(
      network, weights, std::move(activations), RandomMatrix(2, 18, 8));
  std::vector<int> others(network.offset(2));
  for (int i = 0; i < network.offset(2); ++i) others[i] = i;
  const ReducedJacobian reduced(J, others, MatrixXd());
  const auto blocks = reduced.ColumnBlocks();
  ASSERT_EQ(blocks.size(), 2u);
  MatrixXd whole, dense, gram;
  J->ToDense(&whole);
  reduced.ToDense(&dense);
  EXPECT_EQ(dense, whole.leftCols(network.offset(2)));
  EXPECT_EQ(
      ReducedJacobian(J, others, RandomMatrix(18, 1, 9)).ColumnBlocks().size(),
      2u);
  reduced.Gram(&gram);
  EXPECT_LT(
      MatrixXd(
          (gram - dense * dense.transpose()).triangularView<Eigen::Lower>())
          .norm(),
      1e-12 * gram.norm());
}

}  // namespace reduced_jacobian_test
}  // namespace invgrad
