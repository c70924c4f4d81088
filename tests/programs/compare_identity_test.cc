// Which directories and files the program compare takes for its run's own.

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/npy.h"
#include "tests/programs/compare_program.h"

namespace invgrad {
namespace compare_identity_test {

namespace fs = std::filesystem;

// All files of a folder, with what is in them.
std::map<std::string, std::string> Snapshot(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    std::ostringstream text;
    if (entry.is_regular_file()) text << std::ifstream(entry.path()).rdbuf();
    files[entry.path()] = text.str();
  }
  return files;
}

class CompareResume : public CompareProgram {
 protected:
  // The run with these flags cannot go on, and everything is as it was.
  void ExpectNotResumed(const std::vector<std::string>& arguments,
                        const std::string& words) {
    const auto before = Snapshot(Path("run"));
    const Output output = Run(arguments);
    EXPECT_EQ(output.exit_code, 1) << output.text;
    ExpectSays(output, {words, "--overwrite"});
    EXPECT_EQ(Snapshot(Path("run")), before);
  }
};

TEST_F(CompareResume, OtherInputsBehindTheSameFlagsAreNotResumed) {
  ASSERT_EQ(Run(SmallRun("first")).exit_code, 0);
  fs::copy(Path("first/data.npy"), Path("data.npy"));
  fs::copy(Path("first/initial_weights-seed1.npy"), Path("weights.npy"));
  std::vector<std::string> arguments = SmallRun("run");
  arguments.insert(
      arguments.end(),
      {"--data=" + Path("data.npy"), "--init_weights=" + Path("weights.npy")});
  ASSERT_EQ(Run(arguments).exit_code, 0);
  arguments.insert(arguments.end(), {"--resume", "--epochs=5"});
  Eigen::MatrixXd data, weights;
  std::string error;
  ASSERT_TRUE(ReadNpy(Path("data.npy"), -1, -1, &data, &error)) << error;
  ASSERT_TRUE(ReadNpy(Path("weights.npy"), -1, -1, &weights, &error)) << error;
  const auto write = [&] {
    const Eigen::VectorXd vector = weights;
    ASSERT_TRUE(WriteNpy(Path("data.npy"), data, &error)) << error;
    ASSERT_TRUE(WriteNpy(Path("weights.npy"), vector, &error)) << error;
  };
  data(0, 0) *= 1.5;
  write();
  ExpectNotResumed(arguments, "training data");
  data(0, 0) /= 1.5;
  weights(5) = -weights(5);
  write();
  ExpectNotResumed(arguments, "initial weights");
  weights(5) = -weights(5);
  write();
  EXPECT_EQ(Run(arguments).exit_code, 0);
}

TEST_F(CompareResume, AScheduleBelongsToItsBudget) {
  std::vector<std::string> arguments = SmallRun("run");
  arguments[1] = "--rules=half_inverse,adam:schedule=cosine";
  ASSERT_EQ(Run(arguments).exit_code, 0);
  arguments.push_back("--resume");
  EXPECT_EQ(Run(arguments).exit_code, 0);
  arguments[2] = "--epochs=5";
  ExpectNotResumed(arguments, "budget of the schedule: 3 epochs, now budget");
}

TEST_F(CompareResume, ASmallerBudgetIsNotResumed) {
  std::vector<std::string> arguments = SmallRun("run");
  ASSERT_EQ(Run(arguments).exit_code, 0);
  arguments.push_back("--resume");
  arguments[2] = "--epochs=2";
  ExpectNotResumed(arguments, "had --epochs=3, now it is --epochs=2");
  arguments[2] = "--steps=5";  // and the problem's 25 epochs
  ExpectNotResumed(arguments, "a smaller budget");
}

// Copied from another run, damaged, or not finite: named, and left alone.
TEST_F(CompareResume, FilesOfOtherRunsAreNotTaken) {
  const std::vector<std::string> arguments = SmallRun("run");
  ASSERT_EQ(Run(arguments).exit_code, 0);
  std::vector<std::string> other = SmallRun("other");
  other.push_back("--seeds=2");
  ASSERT_EQ(Run(other).exit_code, 0);
  const std::string run = Path("run") + "/half_inverse-seed1/";
  const auto expect_refused = [&](const std::string& file,
                                  const std::string& bytes,
                                  const std::string& words) {
    SCOPED_TRACE(file + ": " + words);
    const auto before = Snapshot(run);
    std::ofstream(run + file) << bytes;
    const auto changed = Snapshot(run);
    std::vector<std::string> resume = arguments;
    resume.insert(resume.end(), {"--epochs=4", "--resume"});
    const bool is_checkpoint = file == "checkpoint";
    ExpectSays(
        Run(resume),
        {run + (is_checkpoint ? "checkpoint: " : "result.txt: ") + words});
    EXPECT_EQ(Snapshot(run), changed);
    for (const auto& [path, text] : before) std::ofstream(path) << text;
  };
  const auto flipped = [&run](const std::string& file) {
    std::string bytes = ReadAll(run + file);
    bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 4);
    return bytes;
  };
  const std::string from_seed = Path("other") + "/half_inverse-seed2/";
  const std::string from_rule = Path("run") + "/adam-step_size-1e-2-seed1/";
  const std::string another = "it is of another run: ";
  expect_refused("result.txt",
                 ReadAll(from_seed + "result.txt"),
                 another + "initial weights: ");
  expect_refused(
      "result.txt",
      ReadAll(from_rule + "result.txt"),
      another + "method: adam:step_size=1e-2, now method: half_inverse");
  const std::string damaged = "it, history.csv or weights.npy is damaged";
  for (const char* file : {"weights.npy", "history.csv"}) {
    expect_refused(file, ReadAll(from_seed + file), damaged);
    expect_refused(file, flipped(file), damaged);
  }
  std::string result = ReadAll(run + "result.txt");
  expect_refused("result.txt", result.substr(7), "not a result of a run");
  result.replace(result.find("saturated "), 11, "saturated 7");
  expect_refused("result.txt", result, damaged);
  expect_refused("checkpoint",
                 ReadAll(from_seed + "checkpoint"),
                 another + "initial weights: ");
  expect_refused(
      "checkpoint",
      ReadAll(from_rule + "checkpoint"),
      another + "method: adam:step_size=1e-2, now method: half_inverse");
  expect_refused(
      "checkpoint", flipped("checkpoint"), "the file is truncated or damaged");
}

TEST_F(CompareResume, OverwriteRemovesWhatARunHasWritten) {
  for (const char* problem : {"--problem=oscillator_chain:num_samples=64",
                              "--problem=squared_component"}) {
    SCOPED_TRACE(problem);
    const std::vector<std::string> arguments = {problem,
                                                "--rules=half_inverse,newton",
                                                "--steps=2",
                                                "--overwrite",
                                                "--output=" + Path("run")};
    for (int i = 0; i < 2; ++i) {
      const Output output = Run(arguments);
      EXPECT_EQ(output.exit_code, 0) << output.text;
    }
    std::ofstream(Path("run") + "/thesis.tex") << "precious";
    const Output output = Run(arguments);
    EXPECT_EQ(output.exit_code, 1);
    ExpectSays(output, {"run/thesis.tex is not a file of the run"});
    fs::remove(Path("run") + "/thesis.tex");
  }
}

}  // namespace compare_identity_test
}  // namespace invgrad
