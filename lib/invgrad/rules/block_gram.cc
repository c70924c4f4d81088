#include "invgrad/rules/block_gram.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <numeric>

#include "invgrad/internal/logging.h"

namespace invgrad {

bool BlockGram::HasPatternOf(const SparseJacobian& J) const {
  const SparseJacobian::Matrix& matrix = J.matrix();
  return outer_.size() == static_cast<std::size_t>(matrix.rows()) + 1 &&
         inner_.size() == static_cast<std::size_t>(matrix.nonZeros()) &&
         std::equal(outer_.begin(), outer_.end(), matrix.outerIndexPtr()) &&
         std::equal(inner_.begin(), inner_.end(), matrix.innerIndexPtr());
}

bool BlockGram::Analyze(const SparseJacobian& J, std::string* error) {
  const SparseJacobian::Matrix& matrix = J.matrix();
  outer_.assign(matrix.outerIndexPtr(),
                matrix.outerIndexPtr() + matrix.rows() + 1);
  inner_.assign(matrix.innerIndexPtr(),
                matrix.innerIndexPtr() + matrix.nonZeros());
  SetBlocks(J.block_sizes(), J.cols());
  if (!GroupRows()) {
    SetBlocks({}, J.cols());
    CHECK(GroupRows());
  }
  NumberAnew(FindPairs());
  const Pairs pairs = FindPairs();
  if (!FindPanels(pairs, error)) {
    outer_.clear();
    return false;
  }
  FindPairOffsets(pairs);
  return true;
}

// Empty: every column is a block.
void BlockGram::SetBlocks(const std::vector<int>& sizes, int num_columns) {
  const std::vector<int> ones(sizes.empty() ? num_columns : 0, 1);
  blocks_.clear();
  int column = 0;
  for (const int size : sizes.empty() ? ones : sizes) {
    Block block;
    block.column = column;
    block.size = size;
    blocks_.push_back(block);
    column += size;
  }
}

// Returns false if a row has entries in a part of a block.
bool BlockGram::GroupRows() {
  std::vector<int> block_of_column;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    block_of_column.insert(
        block_of_column.end(), blocks_[b].size, static_cast<int>(b));
  }
  groups_.clear();
  pieces_.clear();
  const int num_rows = static_cast<int>(outer_.size()) - 1;
  for (int row = 0; row < num_rows;) {
    const auto columns = inner_.begin() + outer_[row];
    const int length = outer_[row + 1] - outer_[row];
    int end = row + 1;
    while (
        end < num_rows && outer_[end + 1] - outer_[end] == length &&
        std::equal(columns, columns + length, inner_.begin() + outer_[end])) {
      ++end;
    }
    RowGroup group;
    group.first_row = row;
    group.num_rows = end - row;
    group.num_columns = length;
    group.first_piece = static_cast<int>(pieces_.size());
    for (int k = 0; k < length;) {
      const int block = block_of_column[columns[k]];
      const int size = blocks_[block].size;
      if (columns[k] != blocks_[block].column || k + size > length ||
          columns[k + size - 1] != columns[k] + size - 1) {
        return false;
      }
      pieces_.push_back({block, k});
      k += size;
    }
    group.num_pieces = static_cast<int>(pieces_.size()) - group.first_piece;
    groups_.push_back(group);
    row = end;
  }
  return true;
}

// Of blocks that share a row, the first of a pair first; sorted. Every block is
// a pair with itself.
BlockGram::Pairs BlockGram::FindPairs() const {
  Pairs pairs;
  for (int b = 0; b < static_cast<int>(blocks_.size()); ++b) {
    pairs.emplace_back(b, b);
  }
  for (const RowGroup& group : groups_) {
    const Piece* const pieces = pieces_.data() + group.first_piece;
    for (int p = 0; p < group.num_pieces; ++p) {
      for (int q = p + 1; q < group.num_pieces; ++q) {
        pairs.emplace_back(pieces[p].block, pieces[q].block);
      }
    }
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

// Independent blocks first: those with the fewest neighbours are taken one
// after the other, unless a neighbour has been taken.
void BlockGram::NumberAnew(const Pairs& pairs) {
  std::vector<std::vector<int>> neighbours(blocks_.size());
  for (const auto& [a, b] : pairs) {
    if (a == b) continue;
    neighbours[a].push_back(b);
    neighbours[b].push_back(a);
  }
  std::vector<int> order(blocks_.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return neighbours[a].size() < neighbours[b].size();
  });
  std::vector<bool> is_excluded(blocks_.size(), false);
  std::vector<bool> is_independent(blocks_.size(), false);
  int num_columns = 0;
  int num_independent_columns = 0;
  for (const int block : order) {
    num_columns += blocks_[block].size;
    if (is_excluded[block]) continue;
    is_independent[block] = true;
    num_independent_columns += blocks_[block].size;
    for (const int other : neighbours[block]) is_excluded[other] = true;
  }
  constexpr double kLeastShare = 0.8;
  num_independent_ = 0;
  if (num_independent_columns < kLeastShare * num_columns) return;

  std::iota(order.begin(), order.end(), 0);
  const auto end =
      std::stable_partition(order.begin(), order.end(), [&](int block) {
        return is_independent[block];
      });
  num_independent_ = static_cast<int>(end - order.begin());
  std::vector<Block> blocks;
  std::vector<int> number(blocks_.size());
  for (const int block : order) {
    number[block] = static_cast<int>(blocks.size());
    blocks.push_back(blocks_[block]);
  }
  blocks_ = std::move(blocks);
  for (Piece& piece : pieces_) piece.block = number[piece.block];
  for (const RowGroup& group : groups_) {
    const auto begin = pieces_.begin() + group.first_piece;
    std::sort(begin,
              begin + group.num_pieces,
              [](const Piece& a, const Piece& b) { return a.block < b.block; });
  }
}

bool BlockGram::FindPanels(const Pairs& pairs, std::string* error) {
  row_blocks_.clear();
  for (const auto& [block, row_block] : pairs) {
    Block& of = blocks_[block];
    if (of.num_row_blocks == 0) {
      of.first_row_block = static_cast<int>(row_blocks_.size());
    }
    ++of.num_row_blocks;
    of.height += blocks_[row_block].size;
    row_blocks_.push_back(row_block);
  }
  std::int64_t num_entries = 0;
  for (Block& block : blocks_) {
    block.first_entry = static_cast<int>(num_entries);
    num_entries += std::int64_t{block.height} * block.size;
    if (num_entries > std::numeric_limits<int>::max()) {
      *error = "J^T J has too many entries for the indices of CHOLMOD";
      return false;
    }
  }
  entries_.resize(static_cast<std::size_t>(num_entries));
  return true;
}

void BlockGram::FindPairOffsets(const Pairs& pairs) {
  std::vector<int> rows_before(pairs.size());  // in the panel
  for (const Block& block : blocks_) {
    int rows = 0;
    for (int k = 0; k < block.num_row_blocks; ++k) {
      rows_before[block.first_row_block + k] = rows;
      rows += blocks_[row_blocks_[block.first_row_block + k]].size;
    }
  }
  pair_offsets_.clear();
  for (RowGroup& group : groups_) {
    group.first_pair = static_cast<int>(pair_offsets_.size());
    const Piece* const pieces = pieces_.data() + group.first_piece;
    for (int p = 0; p < group.num_pieces; ++p) {
      const Block& block = blocks_[pieces[p].block];
      for (int q = p; q < group.num_pieces; ++q) {
        const auto at =
            std::lower_bound(pairs.begin(),
                             pairs.end(),
                             std::pair(pieces[p].block, pieces[q].block));
        pair_offsets_.push_back(block.first_entry +
                                rows_before[at - pairs.begin()]);
      }
    }
  }
}

void BlockGram::Fill(const SparseJacobian& J) {
  std::fill(entries_.begin(), entries_.end(), 0.0);
  const double* const values = J.matrix().valuePtr();
  for (const RowGroup& group : groups_) {
    const double* const G = values + outer_[group.first_row];
    const Piece* const pieces = pieces_.data() + group.first_piece;
    const int* offset = pair_offsets_.data() + group.first_pair;
    for (int p = 0; p < group.num_pieces; ++p) {
      for (int q = p; q < group.num_pieces; ++q, ++offset) {
        AddProduct(group, G, pieces[p], pieces[q], &entries_[*offset]);
      }
    }
  }
}

// The part of J^T J in the columns of a and the rows of b.
void BlockGram::AddProduct(const RowGroup& group,
                           const double* G,
                           const Piece& a,
                           const Piece& b,
                           double* part) {
  const int height = blocks_[a.block].height;
  const int num_columns = blocks_[a.block].size;
  const int num_rows = blocks_[b.block].size;
  for (int i = 0; i < group.num_rows; ++i) {
    const double* const row = G + i * group.num_columns;
    for (int c = 0; c < num_columns; ++c) {
      const double factor = row[a.column + c];
      double* const column = part + c * height;
      for (int r = 0; r < num_rows; ++r) {
        column[r] += factor * row[b.column + r];
      }
    }
  }
}

}  // namespace invgrad
