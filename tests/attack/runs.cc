#include "tests/attack/runs.h"

#include <filesystem>

#include "Eigen/Core"
#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/methods/ceres_methods.h"
#include "invgrad/methods/pull_back_method.h"
#include "invgrad/rules.h"
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

// Every method of the tables, with schedules and in phases.
Names MakeMethods() {
  Names methods = {"adam:schedule=linear",
                   "adam:schedule=cosine",
                   "adam:epochs=2>half_inverse",
                   "half_inverse:steps=5>adam:schedule=exponential",
                   "gauss_newton:steps=3>ceres_lm>sip",
                   "ceres_lm+half_inverse:step_size=auto:rho=1"};
  for (const RuleRow& row : Rules()) methods.push_back(row.name);
  for (const ChainMethodRow& row : ChainMethods()) methods.push_back(row.name);
  for (const CeresMethodRow& row : CeresMethods()) methods.push_back(row.name);
  return methods;
}

std::string AnyProblem(Dice* dice) {
  return dice->Pick(Names{"toy_network",
                          "oscillator_chain",
                          "sine",
                          "multimodal",
                          "regression_1d",
                          "heat_1d:resolution=8"}) +
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

// Consecutive numbers have each method in turn.
Command AnyComparison(std::uint64_t number, Dice* dice) {
  static const auto& methods = *new Names(MakeMethods());
  Command command;
  command.program = "compare";
  std::string rules = methods[number % methods.size()];
  if (dice->OneIn(2)) rules += "," + dice->Pick(methods) + ":batch_size=8";
  command.arguments = {"--problem=" + AnyProblem(dice), "--rules=" + rules};
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
                  AnyRule(dice))};
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
  Command command = dice->seed() % 2 == 0
                        ? AnyComparison(dice->seed() / 2, dice)
                    : dice->OneIn(2) ? AnySweep(dice)
                                     : AnyEstimate(folder, dice);
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
