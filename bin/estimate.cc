/*
Estimates the parameters of nonlinear regressions (NIST StRD, or a formula of
yours on a table), of bundle adjustments (BAL) and of pose graphs (g2o).
Compares rules, Ceres' minimizers, and minimizers with proposals of rules, from
the same starts.

Sample runs:

  estimate --list
  estimate --input=nist/BoxBOD.dat \
    --methods=ceres_lm,ceres_lm+geodesic,ceres_lm+half_inverse:step_size=auto
  estimate --input=nist --plots=false --overwrite \
    --methods=ceres_lm,ceres_bfgs
  estimate --input=nist/Lanczos1.dat --separable=both --overwrite
  estimate --input=problem-16-22106-pre.txt.bz2 --threads=2 --overwrite
  estimate --input=nist/BoxBOD.dat --covariance --overwrite
  estimate --input=decay.csv --model="signal=a*exp(-k*time)+c" \
    --start_values=a=1,k=1,c=0 --bounds=k=0.. --deviations=sigma \
    --covariance --overwrite
  estimate --input=sphere2500.g2o --perturb=0.1 --seeds=1..3 --overwrite \
    --methods=ceres_lm,geodesic,ceres_lm+chordal
  estimate --input=M3500.g2o --loss=huber:1 --overwrite \
    --methods=ceres_lm,ceres_lm:linear_solver=cgnr

docs/results/estimation.md lists the sources of the files. Ctrl-C ends the
current method, skips the others, and keeps the results so far.
*/

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include "bin/estimate/chordal_rule.h"
#include "bin/estimate/estimation_comparison.h"
#include "bin/support/listing.h"
#include "bin/support/program.h"
#include "bin/support/run_output.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/method.h"
#include "invgrad/minimize.h"
#include "problems/estimation/nist_models.h"
#include "problems/estimation/robust_loss.h"

DEFINE_bool(list,
            false,
            "print formats, models and methods with their options");
DEFINE_string(
    input,
    "",
    "files, or folders of them, comma-separated: .dat (NIST, or, with "
    "--model, a table), .csv and .tsv (with --model), .txt or .txt.bz2 "
    "(BAL), .g2o; other files of a folder are skipped");
DEFINE_string(format,
              "",
              "nist, csv, bal or g2o; empty: as the files' names end");
DEFINE_string(
    model,
    "",
    "a regression of your own: \"y = b1*(1 - exp(-b2*x))\"; names of "
    "columns are data, all others are parameters; without \"y =\" the "
    "response is the column y; --list shows operators and functions");
DEFINE_string(start_values,
              "",
              "of --model's parameters: b1=1,b2=0.5; empty: those of a file of "
              "NIST's form");
DEFINE_string(bounds,
              "",
              "of --model's parameters: b1=0..10,b2=0.. (for ceres_lm and "
              "ceres_dogleg)");
DEFINE_string(
    weights,
    "",
    "of --model's squared residuals, a formula of columns: 1/s^2; the "
    "residuals' variance is estimated");
DEFINE_string(
    deviations,
    "",
    "standard deviations of --model's response, a formula of columns; "
    "the residuals' variance is then known");
DEFINE_string(
    edge_error,
    "g2o",
    "of an edge between poses (g2o files): g2o, in the frame of the "
    "measurement, as the format defines it; ceres, in the frame of the first "
    "pose, as in Ceres' examples");
DEFINE_string(
    information_root,
    "",
    "which Cholesky factor of an edge's information weights its error: upper, "
    "as the format defines it; lower, as in Ceres' examples; empty: upper, but "
    "with --edge_error=ceres lower");
DEFINE_string(
    methods,
    "ceres_lm,ceres_dogleg,ceres_lm+geodesic",
    "methods to compare, name[:key=value...],...: a rule, a minimizer "
    "of Ceres, or one with a rule that proposes steps, as "
    "ceres_lm+geodesic; --list shows all");
DEFINE_string(separable,
              "off",
              "on: minimize over the nonlinear parameters, from which the "
              "linear ones follow (nist); both: with and without");
DEFINE_string(start, "both", "of a NIST file: 1, 2, both");
DEFINE_string(loss,
              "none",
              "robust loss: none, or huber, soft_l_one, cauchy, arctan, tukey "
              "[:scale]");
DEFINE_bool(covariance,
            false,
            "standard deviations and correlations of each result (of the "
            "cameras, for BAL), and what the residuals do not determine");
DEFINE_double(perturb,
              0.0,
              "standard deviation of noise on the starts: relative (NIST), in "
              "sizes of the scene and radians (BAL), in units of the graph and "
              "radians (g2o)");
DEFINE_string(seeds, "1", "seeds of the noise: 1,2,5 or 1..20");
DEFINE_int32(max_iterations,
             0,
             "of a run; 0: 10000, 50, 200 (nist and csv, bal, g2o)");
DEFINE_double(seconds,
              0.0,
              "time after which a run begins no iteration; 0: no limit");
DEFINE_double(function_tolerance,
              -1.0,
              "a relative change of the cost that ends a run; -1: 2.2e-16 "
              "(nist, csv), 1e-6 (bal), 1e-9 (g2o)");
DEFINE_int32(threads, 1, "of Ceres and of the linear algebra");

namespace invgrad {
namespace {

namespace fs = std::filesystem;

// A table, with --model, may be called .dat.
std::string KindOf(const std::string& path) {
  const std::string kind =
      FLAGS_format.empty() ? EstimationKindOf(path) : FLAGS_format;
  return kind == "nist" && !FLAGS_model.empty() ? "csv" : kind;
}

// The files in --input, and those files in its folders that a reader
// recognizes, in alphabetical order; a warning says which others have a known
// extension.
bool FindFiles(std::vector<std::string>* files, std::string* error) {
  for (const std::string& item : SplitList(FLAGS_input)) {
    if (item.empty()) {
      *error = "--input=" + FLAGS_input + " has an empty item";
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
      const bool is_table_alone = kind == "csv" && FLAGS_model.empty();
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
           (FLAGS_format.empty() ? "its extension" : FLAGS_format));
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
  if (!FLAGS_model.empty()) return true;
  for (const auto& [name, value] :
       {std::pair("start_values", FLAGS_start_values),
        std::pair("bounds", FLAGS_bounds),
        std::pair("weights", FLAGS_weights),
        std::pair("deviations", FLAGS_deviations)}) {
    if (value.empty()) continue;
    *error = std::string("--") + name + ": only with --model";
    return false;
  }
  return true;
}

bool ReadEdgeError(EdgeError* edge_error, std::string* error) {
  if (!CheckFlag("edge_error", {"g2o", "ceres"}, error) ||
      !CheckFlag("information_root", {"", "lower", "upper"}, error)) {
    return false;
  }
  if (FLAGS_edge_error == "ceres") {
    *edge_error = FLAGS_information_root == "upper" ? EdgeError::kCeresUpper
                                                    : EdgeError::kCeres;
    return true;
  }
  *edge_error = EdgeError::kG2o;
  if (FLAGS_information_root != "lower") return true;
  *error = "--information_root=lower: only with --edge_error=ceres";
  return false;
}

// Reads all files before any run, so that an invalid file is found first.
bool ReadInputs(std::vector<EstimationInput>* inputs, std::string* error) {
  ReadEstimationOptions options;
  options.regression = {FLAGS_model,
                        FLAGS_start_values,
                        FLAGS_bounds,
                        FLAGS_weights,
                        FLAGS_deviations};
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
    for (const EstimationInput& other : *inputs) {
      if (other.name == input.name) {
        *error = "--input: two files are called " + input.name +
                 ", which names the results; run them one by one";
        return false;
      }
    }
    options.kind = KindOf(file);
    if (!FLAGS_model.empty() && !options.kind.empty() &&
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

bool ReadOptions(EstimationOptions* options, std::string* error) {
  if (!CheckFlag("separable", {"off", "on", "both"}, error) ||
      !CheckFlag("start", {"1", "2", "both"}, error) ||
      !CheckFlags({{"perturb", {0.0}},
                   {"max_iterations", {0.0}},
                   {"seconds", {0.0}},
                   {"function_tolerance", {0.0, 1.0, false, true}},
                   {"threads", {1.0, 256.0}}},
                  error) ||
      !ParseFlag("seeds", ParseSeeds, &options->seeds, error) ||
      !ParseFlag("loss", ParseRobustLoss, &options->make_loss, error)) {
    return false;
  }
  options->separable = FLAGS_separable;
  options->start = FLAGS_start;
  options->covariance = FLAGS_covariance;
  options->perturb = FLAGS_perturb;
  options->max_iterations = FLAGS_max_iterations;
  options->seconds = FLAGS_seconds;
  options->function_tolerance = FLAGS_function_tolerance;
  options->threads = FLAGS_threads;
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

bool Run(RunCounts* counts, std::string* error) {
  RegisterChordalRule();
  if (FLAGS_list) {
    std::cout << FormatsText() << "\n" << EstimateListing();
    return true;
  }
  if (FLAGS_input.empty()) {
    *error = "--input is missing: files, or folders of them";
    return false;
  }
  std::vector<Method> methods;
  if (!CheckFlag("format", EstimationKinds(), error) ||
      !ParseFlag("methods", ParseMethods, &methods, error)) {
    return false;
  }
  for (const Method& method : methods) {
    if (!IsForProblems(method, error)) {
      *error = "--methods: " + method.label + ": " + *error;
      return false;
    }
  }
  EstimationOptions options;
  std::vector<EstimationInput> inputs;
  return ReadOptions(&options, error) && ReadInputs(&inputs, error) &&
         CompareEstimations(options, inputs, methods, counts, error);
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(
      argc,
      argv,
      "estimates the parameters of NIST, BAL and g2o files by several "
      "methods\n\n"
      "  estimate --list\n"
      "  estimate --input=BoxBOD.dat --methods=ceres_lm,ceres_lm+geodesic",
      invgrad::Run);
}
