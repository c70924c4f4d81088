// The inverse of A^T A where a few blocks of columns couple all others, as the
// cameras of a bundle adjustment couple its points.
//
//   A = [E F],  E^T E = L L^T block-diagonal,  W = L^-1 E^T F,
//   S = F^T F - W^T W,  Z = (A^T A)^-1 = V S^-1 V^T + [L^-T L^-1, 0; 0, 0],
//   V = [-L^-T W; I]
//
// E has the blocks that no row of A couples, found greedily: those with few
// rows first.
//
// Shapes:  A: m x n, sparse;  S: f x f, dense.
// Cost:    Factorize: for a block of k columns in r rows with c columns of F
//          c^2 k + c k r, and f^3 / 3. Solve: c k for each block, f^2. Entries:
//          once 2 f^3, then c^2 for each.
// Fails:   Factorize returns false with a message if A^T A is not positive
//          definite to rounding.
//
// Source: Triggs, McLauchlan, Hartley, Fitzgibbon. Bundle adjustment, a modern
//     synthesis (2000), section 6.1.
#ifndef INVGRAD_COVARIANCE_SCHUR_COMPLEMENT_H_
#define INVGRAD_COVARIANCE_SCHUR_COMPLEMENT_H_

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Cholesky"
#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "invgrad/covariance/gram_inverse.h"

namespace invgrad {

class SchurComplement final : public GramInverse {
 public:
  // offsets: the first column of each block, and the end.
  SchurComplement(const Eigen::SparseMatrix<double>& A,
                  const std::vector<int>& offsets);

  // Whether S is small enough for dense matrices, and much smaller than A^T A.
  bool IsSmall() const;

  bool Factorize(const Eigen::SparseMatrix<double>& A, std::string* error);
  Eigen::MatrixXd Solve(const Eigen::MatrixXd& B) const override;
  // All of them.
  std::vector<std::optional<double>> Entries(
      const std::vector<std::pair<int, int>>& entries) override;

 private:
  // A block of E.
  struct Block {
    int begin = 0;  // columns of A
    int size = 0;
    std::vector<int> coupled;  // columns of F
    Eigen::MatrixXd L;         // its lower triangle
    Eigen::MatrixXd W;
  };
  // A row of V: its nonzero entries.
  struct Row {
    std::vector<int> columns;
    Eigen::VectorXd values;
  };

  Row RowOfV(int column) const;
  bool AddBlock(const Eigen::SparseMatrix<double>& A,
                const Eigen::SparseMatrix<double, Eigen::RowMajor>& F,
                Block* block,
                Eigen::MatrixXd* S);

  std::vector<Block> blocks_;
  std::vector<int> block_of_;  // of each column of A; -1: a column of F
  std::vector<int> rest_;      // F's columns of A
  std::vector<int> place_;     // of each column of A in rest_; -1: of E
  Eigen::LLT<Eigen::MatrixXd> S_;
  Eigen::MatrixXd S_inverse_;  // empty until Entries needs it
  // Work space of AddBlock, -1 between calls: places of rows and of F's columns.
  std::vector<int> row_place_;
  std::vector<int> column_place_;
};

}  // namespace invgrad

#endif  // INVGRAD_COVARIANCE_SCHUR_COMPLEMENT_H_
