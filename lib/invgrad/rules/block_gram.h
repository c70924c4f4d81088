// J^T J of a sparse J, by blocks of columns: the lower triangle, in panels.
//
// Rows of J with entries in the same columns, as those of a residual block, are
// a dense matrix G. Its columns are pieces, one for each block, and the product
// of two pieces is added to a dense part of J^T J, whose place the pattern
// tells.
//
// Blocks are numbered anew. If at least four fifths of the columns belong to
// blocks that share no row with each other, as the points of a bundle
// adjustment, these come first, num_independent() of them.
//
//   panel of block b: the columns of b, in the rows of b and of all later blocks
//   that share a row of J with it, in their order; stored column by column
//
// Cost:    Analyze: the pairs of pieces, once for a pattern. Fill: the sum of
//          the squares of J's row lengths.
#ifndef INVGRAD_RULES_BLOCK_GRAM_H_
#define INVGRAD_RULES_BLOCK_GRAM_H_

#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "invgrad/stored_jacobian.h"

namespace invgrad {

class BlockGram {
 public:
  struct Block {
    int column = 0;  // in J
    int size = 0;
    int height = 0;       // of the panel
    int first_entry = 0;  // of the panel, in `entries`
    // Of the panel, in rows(): the block itself first.
    int first_row_block = 0;
    int num_row_blocks = 0;
  };

  // Whether J has the pattern that was analyzed last.
  bool HasPatternOf(const SparseJacobian& J) const;

  // Returns false, with *error, if there are too many entries for an int.
  bool Analyze(const SparseJacobian& J, std::string* error);

  void Fill(const SparseJacobian& J);

  const std::vector<Block>& blocks() const { return blocks_; }
  int num_independent() const { return num_independent_; }
  // Blocks in the rows of the panels.
  const std::vector<int>& row_blocks() const { return row_blocks_; }
  const std::vector<double>& entries() const { return entries_; }

 private:
  // Consecutive rows of J with entries in the same columns.
  struct RowGroup {
    int first_row = 0;
    int num_rows = 0;
    int num_columns = 0;
    int first_piece = 0;
    int num_pieces = 0;
    int first_pair = 0;
  };
  // Consecutive columns of a row group that are all of a block.
  struct Piece {
    int block = 0;
    int column = 0;  // in G
  };
  using Pairs = std::vector<std::pair<int, int>>;

  void SetBlocks(const std::vector<int>& sizes, int num_columns);
  bool GroupRows();
  Pairs FindPairs() const;
  void NumberAnew(const Pairs& pairs);
  bool FindPanels(const Pairs& pairs, std::string* error);
  void FindPairOffsets(const Pairs& pairs);
  void AddProduct(const RowGroup& group,
                  const double* G,
                  const Piece& a,
                  const Piece& b,
                  double* part);

  // The pattern of J, in compressed rows.
  std::vector<int> outer_;
  std::vector<int> inner_;
  std::vector<Block> blocks_;
  int num_independent_ = 0;
  std::vector<int> row_blocks_;
  std::vector<RowGroup> groups_;
  std::vector<Piece> pieces_;  // of a group by block
  // Of each pair of pieces of a group, the first entry of its part.
  std::vector<int> pair_offsets_;
  std::vector<double> entries_;
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_BLOCK_GRAM_H_
