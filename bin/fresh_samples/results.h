// What the program fresh_samples has found: tables, files and pictures.
//
//   DIR/fresh_samples.csv, .txt, .md, .png    the grid
//   DIR/calibration.csv, .txt, .md, .png      the rule's own filter
#ifndef BIN_FRESH_SAMPLES_RESULTS_H_
#define BIN_FRESH_SAMPLES_RESULTS_H_

#include <string>
#include <vector>

#include "bin/fresh_samples/probe.h"
#include "invgrad/spectral/spectral_filter.h"

namespace invgrad {

// Gradient descent comes first.
inline constexpr double kFreshKappas[] = {-1.0, 0.0, 0.5, 0.75, 1.0};

struct FreshGridPoint {
  int from = 0;  // the first one of the steps with the same step size
  int step = 0;
  double kappa = 0.0;
  double damping = 0.0;  // relative, as asked for
  double judged = 0.0;   // in units of s^2, as judged
  double generalization = 0.0;
  double noise_scale = 0.0;  // in samples, of all steps with the same `from`
  FreshDecrease decrease;
};

struct FreshRulePoint {
  long step = 0;
  double loss = 0.0;  // of the batch
  SpectralFilter filter;
  double generalization = 0.0;
  FreshDecrease best_step;  // with the step size that is best for fresh samples
  FreshDecrease rules_step;
};

struct FreshResults {
  std::vector<FreshGridPoint> grid;
  std::vector<FreshRulePoint> rule;
};

// Prints the tables, and writes all files to FOLDER. Tables and pictures show
// the grid's means over the steps from each step of `at`, which is ascending.
// Returns false, with *error, if a file cannot be written.
bool WriteFreshResults(const std::string& folder,
                       const std::vector<int>& at,
                       const FreshResults& results,
                       std::string* error);

}  // namespace invgrad

#endif  // BIN_FRESH_SAMPLES_RESULTS_H_
