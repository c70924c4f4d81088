#include "bin/compare/compare_options.h"

#include <string>

#include "bin/support/flags.h"
#include "bin/support/output_options.h"

namespace invgrad {

void CompareOptions::AddFlags() {
  AddFlag("list", &list, "print the problems and methods with their options");
  AddFlag("list_markdown",
          &list_markdown,
          "print docs/rules.md or docs/problems.md: rules, problems");
  AddFlag("problem", &problem, "name[:key=value...]; --list shows all");
  AddFlag("rules",
          &rules,
          "methods to compare, name[:key=value...],...: a rule, "
          "LOSS/SIMULATOR/RULE or a name for one, such as sip, or a "
          "minimizer of Ceres; --list shows all. batch_size is an option of "
          "each in training. In phases: \"adam:epochs=5>half_inverse\". "
          "auto: a few that suit the problem");
  AddFlag("data", &data, "data (.npy) instead of the problem's own");
  AddFlag("seeds",
          &seeds,
          "seeds of the initial weights and of the shuffling, or of the start "
          "of a least-squares problem: 1,2,5 or 1..20");
  AddFlag("levels",
          &levels,
          "train losses, or costs above the known minimum; the table has the "
          "seconds to each");
  AddFlag("blas_threads", &blas_threads, "threads of the linear algebra");
  training.Add();
  AddFlag("target_loss", &target_loss, "stop at this train loss; 0: off");
  AddFlag("patience",
          &patience,
          "stop after so many evaluations without a new minimum of the test "
          "loss; 0: off");
  AddFlag("track_sample",
          &track_sample,
          "training sample whose path in y space is kept; -1: none");
  AddFlag("resume", &resume, "go on with the run in the directory");
  AddFlag(
      "init_weights", &init_weights, "initial weights (.npy) for every seed");
  AddOutputFlags();
}

}  // namespace invgrad
