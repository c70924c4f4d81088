// The columns of a symmetric matrix in strips, which the ranks of a run hold in
// turn.
//
//   strip k = columns kWidth k, kWidth k + 1, .. of rank k mod N
//
// Every rank then has a share of the trailing columns too, as long as there are
// strips enough. A rank stores its strips side by side, with all rows.
#ifndef INVGRAD_CORE_COLUMN_STRIPS_H_
#define INVGRAD_CORE_COLUMN_STRIPS_H_

#include <algorithm>

#include "Eigen/Core"
#include "invgrad/internal/communicator.h"

namespace invgrad {

class ColumnStrips {
 public:
  using Index = Eigen::Index;
  static constexpr Index kWidth = 192;

  // communicator: null for a process that holds all columns.
  ColumnStrips(Index size, const Communicator* communicator)
      : size_(size), communicator_(communicator) {}

  Index size() const { return size_; }
  const Communicator* communicator() const { return communicator_; }
  int num_ranks() const {
    return communicator_ == nullptr ? 1 : communicator_->size();
  }
  int rank() const {
    return communicator_ == nullptr ? 0 : communicator_->rank();
  }

  int Owner(Index column) const {
    return static_cast<int>(column / kWidth % num_ranks());
  }
  bool Owns(Index column) const { return Owner(column) == rank(); }
  // Where the owner stores a column.
  Index Local(Index column) const {
    return column / kWidth / num_ranks() * kWidth + column % kWidth;
  }
  // The number of columns that rank r stores.
  Index NumLocal(int r) const {
    Index count = 0;
    for (Index first = r * kWidth; first < size_;
         first += kWidth * num_ranks()) {
      count += std::min(kWidth, size_ - first);
    }
    return count;
  }
  Index num_local() const { return NumLocal(rank()); }

  // The diagonal of a matrix in strips, on all ranks.
  void GetDiagonal(const Eigen::MatrixXd& K, Eigen::VectorXd* diagonal) const {
    diagonal->setZero(size_);
    ForOwn([&](Index first, Index count) {
      for (Index j = first; j < first + count; ++j) {
        (*diagonal)[j] = K(j, Local(j));
      }
    });
    if (communicator_ != nullptr) communicator_->Sum(diagonal->data(), size_);
  }

  // Calls function(first, count) for this rank's ranges of columns: its strips,
  // or all columns.
  template <typename Function>
  void ForOwn(const Function& function) const {
    if (num_ranks() == 1) {
      function(Index{0}, size_);
      return;
    }
    for (Index first = rank() * kWidth; first < size_;
         first += kWidth * num_ranks()) {
      function(first, std::min(kWidth, size_ - first));
    }
  }

 private:
  Index size_;
  const Communicator* communicator_;
};

}  // namespace invgrad

#endif  // INVGRAD_CORE_COLUMN_STRIPS_H_
