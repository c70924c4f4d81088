// Disjoint sets of 0 ... size - 1, merged by path-halving union-find. Find
// returns the smallest element of a set.
#ifndef INVGRAD_CORE_UNION_FIND_H_
#define INVGRAD_CORE_UNION_FIND_H_

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace invgrad {

class UnionFind {
 public:
  explicit UnionFind(std::size_t size) : parents_(size) {
    std::iota(parents_.begin(), parents_.end(), 0);
  }

  int Find(int i) {
    while (parents_[i] != i) i = parents_[i] = parents_[parents_[i]];
    return i;
  }

  void Join(int i, int j) {
    i = Find(i);
    j = Find(j);
    parents_[std::max(i, j)] = std::min(i, j);
  }

 private:
  std::vector<int> parents_;
};

}  // namespace invgrad

#endif  // INVGRAD_CORE_UNION_FIND_H_
