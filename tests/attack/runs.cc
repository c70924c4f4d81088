#include "tests/attack/runs.h"

#include <filesystem>

#include "Eigen/Core"
#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/methods/ceres_methods.h"
#include "invgrad/methods/pull_back_method.h"
#include "invgrad/rules/rules.h"
#include "problems/estimation/nist_file.h"
#include "tests/support/source_tree.h"

namespace invgrad {
namespace {

using Names = std::vector<std::string>;

std::string AnyRule(Dice* dice) {
  return Rules()[dice->Below(static_cast<int>(Rules().size()))].name;
}

std::string AnyMinimizer(Dice* dice) {
  const std::string name = dice->Pick(CeresMethods()).name;
  const bool is_trust_region = name == "ceres_lm" || name == "ceres_dogleg";
  return is_trust_region && dice->OneIn(2) ? name + "+" + AnyRule(dice) : name;
}

// A method of training.
std::string AnyMethod(Dice* dice) {
  switch (dice->Below(6)) {
    case 0:
      return dice->Pick(ChainMethods()).name;
    case 1:
      return AnyMinimizer(dice);
    case 2:
      return fmt::format("{}:{}>{}",
                         AnyRule(dice),
                         dice->OneIn(2) ? "epochs=2" : "steps=5",
                         dice->OneIn(3) ? AnyMinimizer(dice) : AnyRule(dice));
    case 3:
      return "adam:schedule=" +
             dice->Pick(Names{"linear", "cosine", "exponential"});
    default:
      return AnyRule(dice);
  }
}

std::string AnyProblem(Dice* dice) {
  return dice->Pick(Names{"toy_network",
                          "oscillator_chain",
                          "sine",
                          "exponential",
                          "regression_1d"}) +
         fmt::format(":num_samples={}", 16 + 8 * dice->Below(3));
}

void AddTraining(Dice* dice, Names* arguments) {
  arguments->insert(arguments->end(),
                    {"--hidden=5",
                     "--checkpoint_seconds=0",  // after every step
                     fmt::format("--batch_size={}", 4 + 4 * dice->Below(3)),
                     fmt::format("--epochs={}", 3 + dice->Below(6))});
  if (dice->OneIn(2)) arguments->push_back("--shuffle");
}

Command AnyComparison(Dice* dice) {
  Command command;
  command.program = "compare";
  std::string methods = AnyMethod(dice);
  if (dice->OneIn(2)) methods += "," + AnyMethod(dice) + ":batch_size=8";
  command.arguments = {"--problem=" + AnyProblem(dice), "--rules=" + methods};
  AddTraining(dice, &command.arguments);
  if (dice->OneIn(3)) command.arguments.push_back("--seeds=1,2");
  return command;
}

Command AnySweep(Dice* dice) {
  Command command;
  command.program = "sweep";
  command.arguments = {
      "--problem=" + AnyProblem(dice),
      fmt::format("--grid=rule={},adam:step_size=1e-2|1e-3;seed=1,2",
                  AnyRule(dice)),
      fmt::format("--jobs={}", 1 + dice->Below(3))};
  AddTraining(dice, &command.arguments);
  return command;
}

void Write(const std::string& path, const std::string& text) {
  std::string error;
  CHECK(WriteFile(path, text, &error)) << error;
}

Command AnyEstimate(const std::string& folder, Dice* dice) {
  Command command;
  command.program = "estimate";
  std::string input = "in.dat";
  if (dice->OneIn(2)) {
    Write(folder + input, SmallNistFile());
  } else {
    input = "in.g2o";
    const std::string corpus = SourceDir() + "/tests/fuzz/corpus/g2o_file/";
    std::filesystem::copy_file(corpus + (dice->OneIn(2) ? "plane" : "space"),
                               folder + input);
  }
  command.arguments = {"--input=" + input,
                       "--methods=" + AnyMinimizer(dice) + "," + AnyRule(dice),
                       "--max_iterations=10"};
  if (dice->OneIn(2)) {
    command.arguments.insert(command.arguments.end(),
                             {"--perturb=0.01", "--seeds=1,2"});
  }
  return command;
}

}  // namespace

std::string SmallNistFile() {
  NistData data;
  data.name = "Misra1a";  // y = b_1 (1 - exp(-b_2 x))
  data.predictors = Eigen::VectorXd::LinSpaced(8, 0.5, 4.0);
  data.responses = 2.0 * (1.0 - (-0.5 * data.predictors.array()).exp());
  data.starts.resize(2, 2);
  data.starts << 1.5, 2.5, 0.6, 0.4;
  data.certified = Eigen::Vector2d(2.0, 0.5);
  data.standard_deviations = Eigen::Vector2d(1e-9, 1e-9);
  return NistText(data);
}

Command AnyRun(const std::string& folder, Dice* dice) {
  Command command = dice->OneIn(4)   ? AnySweep(dice)
                    : dice->OneIn(4) ? AnyEstimate(folder, dice)
                                     : AnyComparison(dice);
  command.folder = folder;
  command.arguments.insert(
      command.arguments.end(),
      {"--output=run", "--plots=false", "--progress=false"});
  return command;
}

Command Resumed(Command command) {
  if (command.program == "compare") command.arguments.push_back("--resume");
  if (command.program == "estimate") command.arguments.push_back("--overwrite");
  return command;
}

}  // namespace invgrad
