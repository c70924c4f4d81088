#include "bin/support/output_options.h"

#include "bin/support/flags.h"

namespace invgrad {
namespace {

// For gflags, until the program ends.
OutputOptions& Options() {
  static auto& options = *new OutputOptions;
  return options;
}

}  // namespace

void AddOutputFlags(bool shows_progress) {
  OutputOptions& options = Options();
  AddFlag("output",
          &options.output,
          "directory of the results; empty: runs/ and the program's name");
  AddFlag(
      "overwrite", &options.overwrite, "replace the files of an earlier run");
  AddFlag("plots", &options.plots, "draw the pictures (needs gnuplot)");
  if (shows_progress) {
    AddFlag("progress", &options.progress, "show live how the runs are doing");
  }
}

const OutputOptions& Output() {
  OutputOptions& options = Options();
  if (options.output.empty()) {
    options.output =
        std::string("runs/") + gflags::ProgramInvocationShortName();
  }
  return options;
}

}  // namespace invgrad
