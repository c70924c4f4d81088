#include "problems/estimation/estimation_files.h"

#include <algorithm>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "bin/estimate/chordal_rule.h"
#include "bin/estimate/file_inputs.h"
#include "bin/support/flags.h"
#include "bin/support/program.h"
#include "bin/support/run_output.h"
#include "fmt/core.h"
#include "problems/estimation/estimation.h"
#include "problems/estimation/nist_models.h"
#include "problems/estimation/robust_loss.h"

namespace invgrad {
namespace {

namespace fs = std::filesystem;

// Which files, and how they are read. Its flags are the fields.
struct FileFlags {
  std::string input;
  std::string format;
  std::string model;
  std::string start_values;
  std::string bounds;
  std::string weights;
  std::string deviations;
  std::string edge_error = "g2o";
  std::string separable = "off";
  std::string start = "both";
  std::string loss = "none";
  double perturb = 0.0;
};

// For gflags, until the program ends.
FileFlags& Flags() {
  static auto& flags = *new FileFlags;
  return flags;
}

void AddModelFlags() {
  AddFlag("model",
          &Flags().model,
          "a regression of your own: \"y = b1*(1 - exp(-b2*x))\"; names of "
          "columns are data, all others are parameters; without \"y =\" the "
          "response is the column y; --list shows operators and functions");
  AddFlag("start_values",
          &Flags().start_values,
          "of --model's parameters: b1=1,b2=0.5; empty: those of a file of "
          "NIST's form");
  AddFlag("bounds",
          &Flags().bounds,
          "of --model's parameters: b1=0..10,b2=0.. (for ceres_lm and "
          "ceres_dogleg)");
  AddFlag("weights",
          &Flags().weights,
          "of --model's squared residuals, a formula of columns: 1/s^2; the "
          "residuals' variance is estimated");
  AddFlag("deviations",
          &Flags().deviations,
          "standard deviations of --model's response, a formula of columns; "
          "the residuals' variance is then known");
}

void AddFileFlags() {
  AddFlag("input",
          &Flags().input,
          "files, or folders of them, comma-separated: .dat (NIST, or, with "
          "--model, a table), .csv and .tsv (with --model), .txt or .txt.bz2 "
          "(BAL), .g2o; other files of a folder are skipped");
  AddFlag("format",
          &Flags().format,
          "nist, csv, bal or g2o; empty: as the files' names end");
  AddModelFlags();
  AddFlag(
      "edge_error",
      &Flags().edge_error,
      "of an edge between poses (g2o files): g2o, in the frame of the "
      "measurement, as the format defines it; ceres, in the frame of the first "
      "pose, weighted by the lower Cholesky factor of the information, as in "
      "Ceres' examples; ceres_upper, the same with the upper factor, which is "
      "that of the format");
  AddFlag("separable",
          &Flags().separable,
          "on: minimize over the nonlinear parameters, from which the "
          "linear ones follow (nist); both: with and without");
  AddFlag("start", &Flags().start, "of a NIST file: 1, 2, both");
  AddFlag("loss",
          &Flags().loss,
          "robust loss: none, or huber, soft_l_one, cauchy, arctan, tukey "
          "[:scale]");
  AddFlag("perturb",
          &Flags().perturb,
          "standard deviation of noise on the starts: relative (NIST), in "
          "sizes of the scene and radians (BAL), in units of the graph and "
          "radians (g2o)");
}

// A table, with --model, may be called .dat.
std::string KindOf(const std::string& path) {
  const std::string kind =
      Flags().format.empty() ? EstimationKindOf(path) : Flags().format;
  return kind == "nist" && !Flags().model.empty() ? "csv" : kind;
}

// The files in --input, and those files in its folders that a reader
// recognizes, in alphabetical order; a warning says which others have a known
// extension.
bool FindFiles(std::vector<std::string>* files, std::string* error) {
  for (const std::string& item : SplitList(Flags().input)) {
    if (item.empty()) {
      *error = "--input=" + Flags().input + " has an empty item";
      return false;
    }
    std::error_code failure;
    if (!fs::is_directory(item, failure)) {
      files->push_back(item);
      continue;
    }
    std::vector<std::string> found, skipped;
    for (fs::directory_iterator at(item, failure), end; !failure && at != end;
         at.increment(failure)) {
      std::error_code unreadable;  // such as a dangling link
      const std::string path = at->path().string();
      const std::string kind = KindOf(path);
      const bool is_table_alone = kind == "csv" && Flags().model.empty();
      if (at->is_regular_file(unreadable) && !kind.empty() && !is_table_alone) {
        (IsEstimationFile(path, kind) ? found : skipped).push_back(path);
      }
    }
    if (failure) {
      *error = "--input: " + item + ": " + failure.message();
      return false;
    }
    std::sort(skipped.begin(), skipped.end());
    for (const std::string& path : skipped) {
      Warn("--input: " + path + " is skipped: it does not begin as a file of " +
           (Flags().format.empty() ? "its extension" : Flags().format));
    }
    if (found.empty()) {
      *error = "--input: no file in " + item +
               " is one that --list names; give --format for other extensions";
      return false;
    }
    std::sort(found.begin(), found.end());
    files->insert(files->end(), found.begin(), found.end());
  }
  return true;
}

// "data/problem-16-22106-pre.txt.bz2" -> "problem-16-22106-pre"
std::string InputName(const std::string& file) {
  fs::path name = fs::path(file).filename();
  if (name.extension() == ".bz2") name = name.stem();
  return FileName(name.stem().string());
}

bool CheckModelFlags(std::string* error) {
  if (!Flags().model.empty()) return true;
  for (const auto& [name, value] :
       {std::pair("start_values", Flags().start_values),
        std::pair("bounds", Flags().bounds),
        std::pair("weights", Flags().weights),
        std::pair("deviations", Flags().deviations)}) {
    if (value.empty()) continue;
    *error = std::string("--") + name + ": only with --model";
    return false;
  }
  return true;
}

bool ReadEdgeError(EdgeError* edge_error, std::string* error) {
  if (!CheckFlag("edge_error", {"g2o", "ceres", "ceres_upper"}, error)) {
    return false;
  }
  const std::string& name = Flags().edge_error;
  *edge_error = name == "g2o"     ? EdgeError::kG2o
                : name == "ceres" ? EdgeError::kCeres
                                  : EdgeError::kCeresUpper;
  return true;
}

bool ReadFiles(std::vector<EstimationInput>* inputs, std::string* error) {
  ReadEstimationOptions options;
  options.regression = {Flags().model,
                        Flags().start_values,
                        Flags().bounds,
                        Flags().weights,
                        Flags().deviations};
  if (!CheckModelFlags(error) || !ReadEdgeError(&options.edge_error, error)) {
    return false;
  }
  std::vector<std::string> files;
  if (!FindFiles(&files, error)) return false;
  for (const std::string& file : files) {
    EstimationInput input;
    input.name = InputName(file);
    if (input.name == "." || input.name == "..") {
      *error = "--input: " + file + " has no name for its results";
      return false;
    }
    options.kind = KindOf(file);
    if (!Flags().model.empty() && !options.kind.empty() &&
        options.kind != "csv") {
      *error = "--model: " + file + " is no table, and has a model of its own";
      return false;
    }
    input.estimation = ReadEstimation(file, options, error);
    if (!NameFlag("input", input.estimation != nullptr, error)) return false;
    inputs->push_back(std::move(input));
  }
  return true;
}

bool ReadFlags(EstimationOptions* options, std::string* error) {
  if (!CheckFlag("format", EstimationKinds(), error) ||
      !CheckFlag("separable", {"off", "on", "both"}, error) ||
      !CheckFlag("start", {"1", "2", "both"}, error) ||
      !CheckFlags({{"perturb", {0.0}}}, error) ||
      !NameFlag("loss",
                ParseRobustLoss(Flags().loss, &options->make_loss, error),
                error)) {
    return false;
  }
  options->separable = Flags().separable;
  options->start = Flags().start;
  options->perturb = Flags().perturb;
  return true;
}

// Formats and models of the files.
std::string FormatsText() {
  std::string text =
      "Formats (--input)\n"
      "  .dat            NIST StRD, nonlinear regression (nist)\n"
      "  .txt, .txt.bz2  Bundle Adjustment in the Large (bal); results are "
      ".txt\n"
      "  .g2o            pose graphs in 2D and 3D (g2o)\n"
      "  .csv, .tsv, .dat  a table, with --model (csv); results are .fit.csv\n"
      "\nA model of your own (--model): + - * / ^ -a ( ) < <= > >=, numbers, "
      "pi,\n  exp log log10 sqrt sin cos tan asin acos atan sinh cosh tanh erf "
      "abs,\n  atan2(y, x) pow(a, b) min(a, b) max(a, b) if(condition, a, b)\n"
      "\nModels of NIST's files\n";
  for (const NistModel& model : NistModels()) {
    text += fmt::format("  {}\n    {}\n", model.name, model.formula);
  }
  return text;
}

// Registered problems use no flags of files.
bool CheckProblems(bool has_problems, std::string* error) {
  if (!has_problems) return true;
  std::vector<std::string> names = {"start", "loss", "perturb"};
  if (Flags().input.empty()) {
    names.insert(names.end(),
                 {"format",
                  "model",
                  "start_values",
                  "bounds",
                  "weights",
                  "deviations",
                  "edge_error"});
  }
  return CheckNotGiven(names, "is for files, not for --problems", error);
}

bool ReadInputs(EstimationOptions* options,
                std::vector<EstimationInput>* inputs,
                std::string* error) {
  return CheckProblems(!inputs->empty(), error) && ReadFlags(options, error) &&
         (Flags().input.empty() || ReadFiles(inputs, error));
}

}  // namespace

void RegisterEstimationFiles() {
  RegisterChordalRule();
  SetFileInputs({AddFileFlags, FormatsText, ReadInputs});
}

}  // namespace invgrad
