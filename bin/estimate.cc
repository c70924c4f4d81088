/*
Estimates the parameters of public test problems: nonlinear regression (NIST
StRD), bundle adjustment (BAL) and pose graphs (g2o). Compares rules,
Ceres' minimizers, and minimizers with proposals of rules, from the same starts.

Sample runs:

  estimate --list
  estimate --input=nist/BoxBOD.dat \
    --methods=ceres_lm,ceres_dogleg,ceres_lm+half_inverse:step_size=auto
  estimate --input=nist --plots=false --overwrite \
    --methods=ceres_lm,ceres_bfgs
  estimate --input=problem-16-22106-pre.txt.bz2 --threads=2 --overwrite
  estimate --input=sphere2500.g2o --perturb=0.1 --seeds=1..3 --overwrite
  estimate --input=M3500.g2o --loss=huber:1 --overwrite \
    --methods=ceres_lm,ceres_lm:linear_solver=cgnr

docs/results/estimation.md lists the sources of the files. The run directory
holds the flags that repeat the run, versions, tables, results in the input's
format (uncompressed), iterations (CSV) and pictures (PNG). Ctrl-C ends the
current method, skips the others, and keeps the results so far.
*/

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "bin/estimate/estimation_comparison.h"
#include "bin/support/listing.h"
#include "bin/support/parse_list.h"
#include "bin/support/program.h"
#include "bin/support/run_directory.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/core/blas.h"
#include "invgrad/minimize/method_minimization.h"
#include "problems/estimation/nist_models.h"

DEFINE_bool(list,
            false,
            "print formats, models and methods with their options");
DEFINE_string(input,
              "",
              "files, or folders of them, comma-separated: .dat (NIST), .txt "
              "or .txt.bz2 (BAL), .g2o");
DEFINE_string(format, "", "nist, bal or g2o; empty: as the files' names end");
DEFINE_string(
    information_root,
    "lower",
    "which Cholesky factor of an edge's information weights its residual "
    "(g2o): lower, as in Ceres' examples; upper, as the format defines it");
DEFINE_string(start, "both", "of a NIST file: 1, 2, both");
DEFINE_string(
    methods,
    "ceres_lm,ceres_dogleg",
    "methods to compare, name[:key=value...],...: a rule, a minimizer "
    "of Ceres, or one with a rule that proposes steps, as "
    "ceres_lm+half_inverse; --list shows all");
DEFINE_string(loss,
              "none",
              "robust loss: none, or huber, soft_l_one, cauchy, arctan, tukey "
              "[:scale]");
DEFINE_double(perturb,
              0.0,
              "standard deviation of noise on the starts: relative (NIST), in "
              "sizes of the scene and radians (BAL), in units of the graph and "
              "radians (g2o)");
DEFINE_string(seeds, "1", "seeds of the noise: 1,2,5 or 1..20");
DEFINE_int32(max_iterations, 0, "of a run; 0: 10000, 50, 200 (nist, bal, g2o)");
DEFINE_double(seconds,
              0.0,
              "time after which a run begins no iteration; 0: no limit");
DEFINE_double(function_tolerance,
              -1.0,
              "a relative change of the cost that ends a run; -1: 2.2e-16 "
              "(nist), 1e-6 (bal, g2o)");
DEFINE_int32(threads, 1, "of Ceres and of the linear algebra");

namespace invgrad {
namespace {

namespace fs = std::filesystem;

bool CheckFlags(std::string* error) {
  const std::vector<std::string>& kinds = EstimationKinds();
  return CheckFlag("input", !FLAGS_input.empty(), "files, folders", error) &&
         CheckFlag("format",
                   FLAGS_format.empty() ||
                       std::find(kinds.begin(), kinds.end(), FLAGS_format) !=
                           kinds.end(),
                   "nist, bal, g2o",
                   error) &&
         CheckFlag(
             "start",
             FLAGS_start == "1" || FLAGS_start == "2" || FLAGS_start == "both",
             "1, 2, both",
             error) &&
         CheckFlag("information_root",
                   FLAGS_information_root == "lower" ||
                       FLAGS_information_root == "upper",
                   "lower, upper",
                   error) &&
         CheckFlag("perturb",
                   std::isfinite(FLAGS_perturb) && FLAGS_perturb >= 0.0,
                   "0 (off) or more",
                   error) &&
         CheckFlag("max_iterations",
                   FLAGS_max_iterations >= 0,
                   "0 (usual) or more",
                   error) &&
         CheckFlag("seconds",
                   std::isfinite(FLAGS_seconds) && FLAGS_seconds >= 0.0,
                   "0 (no limit) or more",
                   error) &&
         CheckFlag("function_tolerance",
                   FLAGS_function_tolerance == -1.0 ||
                       (FLAGS_function_tolerance >= 0.0 &&
                        FLAGS_function_tolerance < 1.0),
                   "-1 (usual), or from 0 to less than 1",
                   error) &&
         CheckFlag("threads",
                   FLAGS_threads >= 1 && FLAGS_threads <= 256,
                   "1 to 256",
                   error);
}

// The files in --input, and all files with a known extension in the folders in
// --input, in alphabetical order.
bool FindFiles(std::vector<std::string>* files, std::string* error) {
  std::istringstream items(FLAGS_input);
  for (std::string item; std::getline(items, item, ',');) {
    if (item.empty()) {
      *error = "--input=" + FLAGS_input + " has an empty item";
      return false;
    }
    std::error_code failure;
    if (!fs::is_directory(item, failure)) {
      files->push_back(item);
      continue;
    }
    std::vector<std::string> found;
    for (fs::directory_iterator at(item, failure), end; !failure && at != end;
         at.increment(failure)) {
      std::error_code unreadable;  // such as a dangling link
      const std::string path = at->path().string();
      if (at->is_regular_file(unreadable) &&
          (!FLAGS_format.empty() || !EstimationKindOf(path).empty())) {
        found.push_back(path);
      }
    }
    if (failure) {
      *error = "--input: " + item + ": " + failure.message();
      return false;
    }
    if (found.empty()) {
      *error = "--input: no files in " + item +
               " end in what --list names; give --format";
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

// Reads all files before any run, so that an invalid file is found first.
bool ReadInputs(std::vector<EstimationInput>* inputs, std::string* error) {
  ReadEstimationOptions options;
  options.kind = FLAGS_format;
  options.information_root = FLAGS_information_root == "lower"
                                 ? InformationRoot::kLower
                                 : InformationRoot::kUpper;
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
    input.estimation = ReadEstimation(file, options, error);
    if (input.estimation == nullptr) return false;
    if (FLAGS_start == "2" && input.estimation->num_starts() < 2) {
      *error = "--start=2: " + file + " has one start";
      return false;
    }
    inputs->push_back(std::move(input));
  }
  return true;
}

void PrintEstimateListing(std::ostream& out) {
  out << "Formats (--input)\n"
         "  .dat            NIST StRD, nonlinear regression (nist)\n"
         "  .txt, .txt.bz2  Bundle Adjustment in the Large (bal); results are "
         ".txt\n"
         "  .g2o            pose graphs in 2D and 3D (g2o)\n"
         "\nModels of NIST's files\n";
  for (const NistModel& model : NistModels()) {
    out << "  " << model.name << "\n    " << model.formula << "\n";
  }
  out << "\nRules (--methods=name:key=value:...,...)\n";
  PrintRuleListing(out);
  out << "\nMinimizers of Ceres; ceres_lm+RULE and ceres_dogleg+RULE let a "
         "rule "
         "propose steps.\nlinear_solver is, where nothing is said, dense_qr "
         "for "
         "NIST, a Schur complement for BAL,\nsparse_normal_cholesky for g2o\n";
  PrintCeresListing(out);
}

int Run() {
  if (FLAGS_list) {
    PrintEstimateListing(std::cout);
    return 0;
  }
  std::string error;
  if (!CheckFlags(&error)) return Fail(error);
  EstimationComparisonOptions options;
  if (!ParseSeeds(FLAGS_seeds, &options.seeds, &error)) {
    return Fail("--seeds: " + error);
  }
  if (!ParseRobustLoss(FLAGS_loss, &options.make_loss, &error)) {
    return Fail("--loss: " + error);
  }
  std::vector<Method> methods;
  if (!ParseMethods(FLAGS_methods, &methods, &error)) {
    return Fail("--methods: " + error);
  }
  for (const Method& method : methods) {
    if (!IsForProblems(method, &error)) {
      return Fail("--methods: " + method.label + ": " + error);
    }
  }
  std::vector<EstimationInput> inputs;
  if (!ReadInputs(&inputs, &error)) return Fail(error);
  if (FLAGS_start != "2") options.starts.push_back(0);
  if (FLAGS_start != "1") options.starts.push_back(1);
  options.perturbation = FLAGS_perturb;
  options.max_num_iterations = FLAGS_max_iterations;
  options.max_time_in_seconds = FLAGS_seconds;
  options.function_tolerance = FLAGS_function_tolerance;
  options.num_threads = FLAGS_threads;
  SetBlasThreads(FLAGS_threads);
  for (const EstimationInput& input : inputs) {
    std::cout << input.name << ": " << input.estimation->Description() << "\n";
  }
  std::cout << "\n";
  if (!PrepareRunDirectory(ExistingDirectory::kRefuse, &error)) {
    return Fail(error);
  }
  options.output = FLAGS_output;
  return CompareEstimations(inputs, methods, options, std::cout, &error)
             ? 0
             : Fail(error);
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
      "  estimate --input=BoxBOD.dat --methods=ceres_lm,ceres_lm+half_inverse",
      invgrad::Run);
}
