// How well predictions agree with what was measured.
#ifndef BIN_FRESH_SAMPLES_AGREEMENT_H_
#define BIN_FRESH_SAMPLES_AGREEMENT_H_

#include <vector>

namespace invgrad {

// Pairs with a value that is not finite do not count.
struct Agreement {
  Agreement(const std::vector<double>& predicted,
            const std::vector<double>& measured);

  int num_pairs = 0;
  // Spearman's: the correlation of the ranks, ties sharing their mean rank. NaN
  // for fewer than two pairs, or if all values of one side are equal.
  double rank_correlation;
  // Of measured / predicted, where predicted > 0; NaN without such a pair.
  double median_ratio;
};

}  // namespace invgrad

#endif  // BIN_FRESH_SAMPLES_AGREEMENT_H_
