// The answer of a comparison as a paragraph, from its numbers.
#ifndef REPORT_ANSWER_H_
#define REPORT_ANSWER_H_

#include <string>
#include <utility>
#include <vector>

namespace invgrad {

// What a method reached over the seeds; smaller is better.
struct Score {
  std::string name;
  double median = 0.0;  // not finite: it failed, or did not run
  double low = 0.0;
  double high = 0.0;
  int num_seeds = 0;            // 0: seeds play no part
  bool is_first_order = false;  // its steps read gradients alone
};

// Which method has the lowest median, by what factor over the next one and over
// the best first-order method, and whether the ranges of the seeds overlap.
// `value`: "test loss". Empty without scores.
std::string AnswerByScores(const std::string& value,
                           const std::vector<Score>& scores);

// Who comes first how often: "adaptive has the lowest test loss at 5 of 6 points
// of the grid, adam at 1." `verb`: "has the lowest test loss", `at`: "at",
// `places`: "points of the grid". Names that come first nowhere are left out.
std::string AnswerByCounts(
    const std::string& verb,
    const std::string& at,
    const std::string& places,
    const std::vector<std::pair<std::string, int>>& counts,
    int num_places);

// "a", "a and b", "a, b and c".
std::string JoinNames(const std::vector<std::string>& names);

}  // namespace invgrad

#endif  // REPORT_ANSWER_H_
