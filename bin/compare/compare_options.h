// What a comparison is. Its flags are the fields.
#ifndef BIN_COMPARE_COMPARE_OPTIONS_H_
#define BIN_COMPARE_COMPARE_OPTIONS_H_

#include <string>

#include "bin/support/training_flags.h"

namespace invgrad {

struct CompareOptions {
  bool list = false;
  std::string list_markdown;
  std::string problem;         // name[:key=value...]
  std::string rules = "auto";  // method,...; auto: some that suit the problem
  std::string data;            // a file in place of the problem's own data
  std::string seeds = "1";
  std::string levels = "1e-3,1e-4,1e-5";
  int blas_threads = 1;
  TrainingFlags training;
  double target_loss = 0.0;
  int patience = 0;
  int track_sample = 0;
  bool resume = false;
  std::string init_weights;  // a file

  // Adds a flag for each field, under its name.
  void AddFlags();
};

}  // namespace invgrad

#endif  // BIN_COMPARE_COMPARE_OPTIONS_H_
