// Samples in lanes: four samples of a batch at once, as packs (pack.h).
#ifndef INVGRAD_INTERNAL_LANES_H_
#define INVGRAD_INTERNAL_LANES_H_

#include <cstddef>
#include <type_traits>

#include "invgrad/internal/pack.h"

namespace invgrad {

// False for a functor with `static constexpr bool kInLanes = false`: one that
// has no template for every scalar, such as an overload for Jets of doubles.
template <typename Functor, typename = void>
struct WantsLanes : std::true_type {};
template <typename Functor>
struct WantsLanes<Functor, std::void_t<decltype(Functor::kInLanes)>>
    : std::bool_constant<Functor::kInLanes> {};

constexpr char kLanesDeclined[] = "the functor sets kInLanes = false";

// Whether all values of all lanes are finite: 0 x is zero for a finite x only.
inline bool AreLanesFinite(const Pack* packs, std::ptrdiff_t size) {
  const auto is_zero = [](const Pack& sum) {
    return (sum[0] + sum[1]) + (sum[2] + sum[3]) == 0.0;
  };
  constexpr int kNumSums = 8;  // independent, to hide the latency of a sum
  std::ptrdiff_t i = 0;
  Pack rest;
  for (; i < size % kNumSums; ++i) rest += packs[i] * Pack(0.0);
  if (i == size) return is_zero(rest);
  return CallInlinedFor<Pack>([&] {
    Pack sums[kNumSums];
    for (; i < size; i += kNumSums) {
      for (int k = 0; k < kNumSums; ++k) sums[k] += packs[i + k] * Pack(0.0);
    }
    for (const Pack& sum : sums) rest += sum;
    return is_zero(rest);
  });
}

// packs[i] = entry i of four columns of `size` entries.
inline void LoadLanes(const double* columns, std::ptrdiff_t size, Pack* packs) {
  for (std::ptrdiff_t i = 0; i < size; ++i) {
    for (int lane = 0; lane < Pack::kLanes; ++lane) {
      packs[i].v[lane] = columns[lane * size + i];
    }
  }
}

inline void StoreLanes(const Pack* packs,
                       std::ptrdiff_t size,
                       double* columns) {
  for (std::ptrdiff_t i = 0; i < size; ++i) {
    for (int lane = 0; lane < Pack::kLanes; ++lane) {
      columns[lane * size + i] = packs[i][lane];
    }
  }
}

// Logs once, with --v=1, that the branches of a functor differ between samples.
void LogDifferentBranches();

// Calls in_lanes(s) for the four samples from s on, and one(s) for each sample
// of a pack for which it returns false or the branches differ, of an incomplete
// pack and, unless `has_lanes`, of all. Returns the first sample for which one(s)
// is false, or `count`.
template <typename InLanes, typename One>
int ForSamplesInLanes(int count,
                      bool has_lanes,
                      const InLanes& in_lanes,
                      const One& one) {
  // The packs with different branches after which the others are not tried.
  constexpr int kMaxNumDifferent = 2;
  int num_different = 0;
  int s = 0;
  while (s < count) {
    int end = s + 1;
    if (has_lanes && num_different < kMaxNumDifferent &&
        count - s >= Pack::kLanes) {
      end = s + Pack::kLanes;
      PackBranches::Reset();
      const bool is_done = in_lanes(s);
      if (PackBranches::differ()) {
        ++num_different;
        LogDifferentBranches();
      } else if (is_done) {
        s = end;
      }
    }
    for (; s < end; ++s) {
      if (!one(s)) return s;
    }
  }
  return count;
}

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_LANES_H_
