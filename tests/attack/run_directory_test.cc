// Run directories with damaged, lost, exchanged and strange files: a run that
// goes on from one ends as it should, or refuses to.

#include <fstream>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/attack/attack.h"
#include "tests/attack/child.h"
#include "tests/attack/mutation.h"
#include "tests/attack/refusal.h"
#include "tests/attack/run_files.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace run_directory_test {

// compare and sweep name the directories of their runs differently.
Command Learning(const std::string& program,
                 const std::string& problem,
                 const std::string& seed,
                 int epochs) {
  Command command;
  command.program = program;
  command.arguments = {"--problem=" + problem,
                       "--hidden=5",
                       "--batch_size=4",
                       "--shuffle",
                       "--epochs=" + std::to_string(epochs),
                       "--plots=false",
                       "--progress=false",
                       "--output=run"};
  const std::string rules = "adam,half_inverse,adam:steps=5>gauss_newton";
  if (program == "compare") {
    command.arguments.push_back("--rules=" + rules);
    command.arguments.push_back("--seeds=" + seed);
  } else {
    command.arguments.push_back("--grid=rule=" + rules + ";seed=" + seed);
  }
  return command;
}

Files FilesOf(Command command) {
  const TemporaryFolder folder;
  command.folder = folder / "";
  const Outcome outcome = RunChild(command);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  return ReadFiles(folder / "run");
}

// A program, the directory of its short run, those of others, and the results
// of the long run that continues it.
struct Scene {
  std::string program;
  Files pristine;
  std::vector<Files> others;
  Files expected;
};

constexpr int kShort = 3;
constexpr int kLong = 6;

Scene MakeScene(const std::string& program) {
  const std::string problem = "toy_network:num_samples=16";
  return {program,
          FilesOf(Learning(program, problem, "1", kShort)),
          {FilesOf(Learning(program, problem + ":lambda=2", "1", kShort)),
           FilesOf(Learning(program, problem, "2", kShort)),
           FilesOf(Learning(program, problem, "1", kShort - 1))},
          Results(FilesOf(Learning(program, problem, "1", kLong)))};
}

std::string AnyFile(const Files& files, Dice* dice) {
  std::vector<std::string> names;
  for (const auto& [name, content] : files) {
    if (content != "folder") names.push_back(name);
  }
  return dice->Pick(names);
}

// Changes one file; returns what was done.
std::string Damage(const Scene& scene, Dice* dice, Files* files) {
  const std::string name = AnyFile(*files, dice);
  switch (dice->Below(5)) {
    case 0:
      files->erase(name);
      return "lost " + name;
    case 1: {  // of another run of the program, or of another method
      const Files& other = dice->Pick(scene.others);
      const std::string from =
          dice->OneIn(2) && other.count(name) > 0 ? name : AnyFile(other, dice);
      (*files)[name] = other.at(from);
      return "another run's " + from + " as " + name;
    }
    case 2: {
      const std::string from = AnyFile(*files, dice);
      (*files)[name] = files->at(from);
      return from + " as " + name;
    }
    default:
      (*files)[name] = Mutated((*files)[name], dice);
      return "mutated " + name;
  }
}

TEST(RunDirectoryAttack, DamagedRunsEndAsTheyShouldOrAreRefused) {
  const std::vector<Scene> scenes = {MakeScene("compare"), MakeScene("sweep")};
  Attack([&](Dice* dice) {
    const Scene& scene = dice->Pick(scenes);
    const TemporaryFolder folder;
    Files files = scene.pristine;
    std::string damage = Damage(scene, dice, &files);
    if (dice->OneIn(3)) damage += ", " + Damage(scene, dice, &files);
    WriteFiles(files, folder / "run");
    if (dice->OneIn(8)) {
      const std::string name = AnyFile(files, dice);
      damage += ", " + MakeStrange(folder / ("run/" + name), dice) + " " + name;
    }
    std::ofstream(folder / "run/keep") << "a file of the user";
    SCOPED_TRACE(damage);

    Command command =
        Learning(scene.program, "toy_network:num_samples=16", "1", kLong);
    command.folder = folder / "";
    if (dice->OneIn(5)) {
      command.arguments.push_back("--overwrite");
    } else if (scene.program == "compare") {
      command.arguments.push_back("--resume");
    }
    const Files before = Results(ReadFiles(folder / "run"));
    const Outcome outcome = RunOrRefuse(command, {"run", "keep"});
    const Files results = Results(ReadFiles(folder / "run"));
    if (outcome.exit_code == 0) {
      EXPECT_EQ(FindDifference(results, scene.expected), "") << outcome.text;
      return;
    }
    // Methods that could not go on are left as they were.
    for (const auto& [name, content] : results) {
      const bool is_new =
          scene.expected.count(name) > 0 && content == scene.expected.at(name);
      EXPECT_TRUE(is_new ||
                  (before.count(name) > 0 && content == before.at(name)))
          << name << " is neither old nor new: " << content << outcome.text;
    }
  });
}

}  // namespace run_directory_test
}  // namespace invgrad
