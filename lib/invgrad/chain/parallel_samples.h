// Applies a function to each of `count` samples, in contiguous shares per
// thread.
//
// The samples must be independent; the result then does not depend on the
// number of threads. One thread means the calling thread.
#ifndef INVGRAD_CHAIN_PARALLEL_SAMPLES_H_
#define INVGRAD_CHAIN_PARALLEL_SAMPLES_H_

#include <algorithm>
#include <thread>
#include <vector>

namespace invgrad {

template <typename Function>
void ParallelSamples(int count, int num_threads, const Function& function) {
  const int shares = std::max(1, std::min(num_threads, count));
  const auto run = [&](int share) {
    const auto bound = [&](int k) {
      return static_cast<int>(static_cast<long>(count) * k / shares);
    };
    for (int s = bound(share); s < bound(share + 1); ++s) function(s);
  };
  std::vector<std::thread> threads;
  threads.reserve(shares - 1);
  for (int share = 1; share < shares; ++share) threads.emplace_back(run, share);
  run(0);
  for (std::thread& thread : threads) thread.join();
}

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_PARALLEL_SAMPLES_H_
