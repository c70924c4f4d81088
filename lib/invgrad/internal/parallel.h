// Threads over the samples of a batch.
#ifndef INVGRAD_INTERNAL_PARALLEL_H_
#define INVGRAD_INTERNAL_PARALLEL_H_

#include <algorithm>
#include <exception>
#include <thread>
#include <vector>

#include "invgrad/internal/pack.h"

namespace invgrad {

// Splits the samples 0 .. count - 1 into contiguous shares of a multiple of
// `grain`, one a thread; the calling thread has the first. function(begin, end)
// computes a share and returns the first sample that fails, or `end`. Returns
// the first sample of all shares that fails, or `count`. Shares that call BLAS
// wait for each other if it has several threads (blas_threads.h). An exception
// reaches the caller, unless a sample of an earlier share fails.
template <typename Function>
int ForShares(int count,
              int num_threads,
              const Function& function,
              int grain = Pack::kLanes) {
  const int num_grains = (count + grain - 1) / grain;
  const int num_shares = std::max(1, std::min(num_threads, num_grains));
  if (num_shares == 1) return function(0, count);
  const auto bound = [&](int k) {
    const long first = static_cast<long>(num_grains) * k / num_shares;
    return static_cast<int>(std::min<long>(count, first * grain));
  };
  std::vector<int> firsts(num_shares);  // the first sample that fails
  std::vector<std::exception_ptr> exceptions(num_shares);
  const auto run = [&](int k) {
    try {
      firsts[k] = function(bound(k), bound(k + 1));
    } catch (...) {
      exceptions[k] = std::current_exception();
    }
  };
  std::vector<std::thread> threads;
  for (int k = 1; k < num_shares; ++k) threads.emplace_back(run, k);
  run(0);
  for (std::thread& thread : threads) thread.join();
  for (int k = 0; k < num_shares; ++k) {
    if (exceptions[k] != nullptr) std::rethrow_exception(exceptions[k]);
    if (firsts[k] < bound(k + 1)) return firsts[k];
  }
  return count;
}

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_PARALLEL_H_
