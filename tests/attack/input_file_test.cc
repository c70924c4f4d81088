// Damaged and strange files, given to the readers and to the programs.

#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/dense_network.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/npy.h"
#include "invgrad/train.h"
#include "invgrad/train/checkpoint.h"
#include "invgrad/train/run_identity.h"
#include "problems/estimation/bal_file.h"
#include "problems/estimation/g2o_file.h"
#include "problems/estimation/nist_file.h"
#include "tests/attack/attack.h"
#include "tests/attack/child.h"
#include "tests/attack/mutation.h"
#include "tests/attack/refusal.h"
#include "tests/attack/run_files.h"
#include "tests/attack/runs.h"
#include "tests/support/reader_check.h"
#include "tests/support/source_tree.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace input_file_test {

std::string Corpus(const std::string& file) {
  std::string text, error;
  EXPECT_TRUE(
      ReadFile(SourceDir() + "/tests/fuzz/corpus/" + file, &text, &error))
      << error;
  return text;
}

void Write(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

// A run's directory, with a file of each kind.
Files MakeRun(const TemporaryFolder& folder) {
  Command command;
  command.program = "compare";
  command.folder = folder / "";
  command.arguments = {"--problem=toy_network:num_samples=16",
                       "--rules=adam",
                       "--steps=5",
                       "--plots=false",
                       "--output=run"};
  const Outcome outcome = RunChild(command);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  return ReadFiles(folder / "run");
}

// The content of a checkpoint.
std::string Checkpoint(const std::string& path) {
  StateArchive archive;
  Eigen::VectorXd weights = Eigen::VectorXd::LinSpaced(7, -1.0, 1.0);
  archive.Visit("weights", &weights);
  std::string bytes, error;
  EXPECT_TRUE(archive.Write(path, RunIdentity(), &error)) << error;
  EXPECT_TRUE(ReadFile(path, &bytes, &error)) << error;
  return bytes;
}

// A message, or data without one.
void ExpectRefusedOrRead(bool is_read,
                         const std::string& error,
                         const std::string& name) {
  EXPECT_EQ(error.empty(), is_read) << error;
  EXPECT_TRUE(is_read || error.find(name) != std::string::npos) << error;
  Count(is_read ? "read" : "refused");
}

TEST(InputAttack, ReadersRefuseOrRead) {
  const TemporaryFolder folder;
  const Files run = MakeRun(folder);
  const std::string npy = run.at("data.npy");
  const std::string history = run.at("adam-seed1/history.csv");
  const std::string network = run.at("adam-seed1/network.txt");
  const std::string checkpoint = Checkpoint(folder / "checkpoint");
  const std::string nist = SmallNistFile();
  const std::string bal = Corpus("bal_file/small");
  const std::string bal_bz2 = Corpus("bal_file/small_bz2");
  const std::string g2o = Corpus("g2o_file/space");
  const std::string path = folder / "input";
  Attack([&](Dice* dice) {
    std::string error;
    bool is_read = false;
    switch (dice->Below(7)) {
      case 0: {
        Write(path, Mutated(npy, dice));
        Eigen::MatrixXd matrix;
        is_read = ReadNpy(path, -1, -1, &matrix, &error);
        break;
      }
      case 1: {
        Write(path, Mutated(history, dice));
        History rows;
        is_read = ReadHistory(path, &rows, &error);
        break;
      }
      case 2: {
        Write(path, Mutated(network, dice));
        Eigen::VectorXd weights;
        is_read = ReadNetwork(path, &weights, &error).has_value();
        break;
      }
      case 3: {
        Write(path, Mutated(checkpoint, dice));
        error = StateArchive::Read(path, RunIdentity()).error();
        is_read = error.empty();
        break;
      }
      case 4:
        EXPECT_EQ(FindReaderFlaw(TextFormat<NistData>{ParseNist, NistText},
                                 Mutated(nist, dice)),
                  "");
        Count("parsed");
        return;
      case 5:
        EXPECT_EQ(FindReaderFlaw(TextFormat<PoseGraph>{ParseG2o, G2oText},
                                 Mutated(g2o, dice)),
                  "");
        Count("parsed");
        return;
      default:
        EXPECT_EQ(FindReaderFlaw(TextFormat<BalData>{ParseBal, BalText},
                                 Mutated(dice->OneIn(4) ? bal_bz2 : bal, dice)),
                  "");
        Count("parsed");
        return;
    }
    ExpectRefusedOrRead(is_read, error, path);
  });
}

// A program, its arguments, and the input file that they name.
struct Use {
  std::string program;
  std::vector<std::string> arguments;
  std::string name;
  std::string content;
};

TEST(InputAttack, ProgramsRefuseOrRun) {
  const TemporaryFolder source;
  const Files run = MakeRun(source);
  const auto compare = [](const std::string& flag) {
    return std::vector<std::string>{"--problem=toy_network:num_samples=16",
                                    "--rules=adam",
                                    "--steps=2",
                                    flag};
  };
  const auto estimate = [](const std::string& input) {
    return std::vector<std::string>{"--input=" + input,
                                    "--methods=ceres_lm,half_inverse",
                                    "--max_iterations=3"};
  };
  const std::vector<Use> uses = {
      {"compare", compare("--data=in.npy"), "in.npy", run.at("data.npy")},
      {"compare",
       compare("--init_weights=in.npy"),
       "in.npy",
       run.at("initial_weights-seed1.npy")},
      {"estimate", estimate("in.dat"), "in.dat", SmallNistFile()},
      {"estimate", estimate("in.txt"), "in.txt", Corpus("bal_file/small")},
      {"estimate",
       estimate("in.txt.bz2"),
       "in.txt.bz2",
       Corpus("bal_file/small_bz2")},
      {"estimate", estimate("in.g2o"), "in.g2o", Corpus("g2o_file/plane")},
      {"estimate", estimate("in.g2o"), "in.g2o", Corpus("g2o_file/space")},
      {"estimate", estimate("."), "in.g2o", Corpus("g2o_file/space")},
  };
  Attack([&](Dice* dice) {
    const TemporaryFolder folder;
    const Use& use = dice->Pick(uses);
    Command command;
    command.program = use.program;
    command.folder = folder / "";
    command.arguments = use.arguments;
    command.arguments.insert(
        command.arguments.end(),
        {"--output=run", "--plots=false", "--progress=false"});
    std::string what = "mutated";
    if (dice->OneIn(4)) {
      what = MakeStrange(folder / use.name, dice);
    } else {
      Write(folder / use.name, Mutated(use.content, dice));
    }
    SCOPED_TRACE(use.name + ": " + what);
    Count(what);
    const Outcome outcome = RunOrRefuse(command, {use.name, "--input"});
    EXPECT_TRUE(outcome.exit_code != 0 || what == "mutated" ||
                use.arguments[0] == "--input=.")
        << what << " is read: " << outcome.text;
  });
}

}  // namespace input_file_test
}  // namespace invgrad
