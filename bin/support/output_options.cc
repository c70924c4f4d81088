#include "bin/support/output_options.h"

#include "bin/support/flags.h"

namespace invgrad {
namespace {

OutputOptions& Options() {
  static auto& options = *new OutputOptions;
  return options;
}

}  // namespace

void OutputOptions::AddFlags(bool shows_progress) {
  AddFlag("output",
          &output,
          "directory of the results; empty: runs/ and the program's name");
  AddFlag("overwrite", &overwrite, "replace the files of an earlier run");
  AddFlag("plots", &plots, "draw the pictures (needs gnuplot)");
  if (shows_progress) {
    AddFlag("progress", &progress, "show live how the runs are doing");
  }
}

void SetOutput(OutputOptions* options) {
  if (options->output.empty()) {
    options->output =
        std::string("runs/") + gflags::ProgramInvocationShortName();
  }
  Options() = *options;
}

const OutputOptions& Output() { return Options(); }

}  // namespace invgrad
