// Directories of runs: which are made, reused, emptied or left alone.

#include "bin/support/run_directory.h"

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "bin/support/learning_run.h"
#include "gtest/gtest.h"
#include "invgrad/method.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace run_directory_test {

namespace fs = std::filesystem;

bool Prepare(const std::string& path,
             ExistingDirectory existing,
             const std::string& flags,
             std::string* error) {
  error->clear();
  return PrepareRunDirectory(path, existing, RunIdentity(), flags, error);
}

TEST(RunDirectory, AnEmptyDirectoryIsAsGoodAsNone) {
  const TemporaryFolder folder;
  std::string error;
  fs::create_directories(folder / "empty");
  for (const char* name : {"empty", "new/deeper"}) {
    EXPECT_TRUE(Prepare(
        folder / name, ExistingDirectory::kRefuse, "--steps=1\n", &error))
        << error;
    EXPECT_TRUE(fs::exists(folder / name + "/flags.txt"));
    EXPECT_TRUE(fs::exists(folder / name + "/versions.txt"));
  }
}

TEST(RunDirectory, ResumeWantsTheSameRunWithAnyBudgetAndOutput) {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  const auto resume = ExistingDirectory::kResume;
  std::string error;
  ASSERT_TRUE(Prepare(run,
                      ExistingDirectory::kRefuse,
                      "--rules=adam:step_size=1\n--epochs=3\n--plots=true\n",
                      &error));
  EXPECT_FALSE(
      Prepare(run, resume, "--rules=adam:step_size=2\n--epochs=3\n", &error));
  EXPECT_NE(error.find("had --rules=adam:step_size=1, now it is "
                       "--rules=adam:step_size=2; give another --output, or "
                       "--overwrite"),
            std::string::npos)
      << error;
  EXPECT_TRUE(Prepare(run,
                      resume,
                      "--rules=adam:step_size=1\n--epochs=9\n--plots=false\n",
                      &error))
      << error;
}

TEST(RunDirectory, WhatNoRunMadeIsLeftAlone) {
  const TemporaryFolder folder;
  std::string error;
  std::ofstream(folder / "file") << "precious";
  fs::create_directories(folder / "other");
  std::ofstream(folder / "other/thesis.tex") << "precious";
  for (const char* name : {"file", "other"}) {
    for (const auto existing : {ExistingDirectory::kRefuse,
                                ExistingDirectory::kOverwrite,
                                ExistingDirectory::kResume}) {
      EXPECT_FALSE(Prepare(folder / name, existing, "--steps=1\n", &error));
      EXPECT_NE(error.find(folder / name), std::string::npos) << error;
    }
  }
  EXPECT_TRUE(fs::exists(folder / "other/thesis.tex"));
  // Where no directory can be made.
  EXPECT_FALSE(Prepare(
      folder / "file/run", ExistingDirectory::kRefuse, "--steps=1\n", &error));
  EXPECT_EQ(error.rfind("--output: ", 0), 0u) << error;
}

constexpr auto kRefuse = ExistingDirectory::kRefuse;
constexpr auto kOverwrite = ExistingDirectory::kOverwrite;
constexpr auto kResume = ExistingDirectory::kResume;

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

// A directory with the results of a run.
class RunDirectoryOfARun : public testing::Test {
 protected:
  RunDirectoryOfARun() {
    std::string error;
    EXPECT_TRUE(Prepare(run_, kRefuse, "--steps=1\n", &error)) << error;
    fs::create_directories(run_ + "/adam-seed1");
    for (const std::string& file : files_) {
      EXPECT_TRUE(WriteRunFile(run_ + file, "result", &error)) << error;
    }
  }

  // Refused with these words, and nothing has changed.
  void ExpectRefused(ExistingDirectory existing,
                     const std::string& path,
                     const std::string& words) {
    const auto before = Snapshot(folder_ / "");
    std::string error;
    EXPECT_FALSE(Prepare(path, existing, "--steps=1\n", &error));
    EXPECT_NE(error.find(words), std::string::npos) << error;
    EXPECT_EQ(Snapshot(folder_ / ""), before);
  }

  const TemporaryFolder folder_;
  const std::string run_ = folder_ / "run";
  const std::vector<std::string> files_ = {
      "/table.txt", "/adam-seed1/history.csv", "/adam-seed1/result.txt"};
};

TEST_F(RunDirectoryOfARun, OverwriteRemovesItsFilesAlone) {
  std::string error;
  for (const char* path : {"run", "run/"}) {
    ASSERT_TRUE(Prepare(folder_ / path, kOverwrite, "--steps=2\n", &error))
        << error;
    EXPECT_EQ(Snapshot(run_).size(), 3u);  // flags, versions, list of files
    EXPECT_NE(Snapshot(run_)[run_ + "/flags.txt"].find("--steps=2"),
              std::string::npos);
  }
}

TEST_F(RunDirectoryOfARun, OverwriteRefusesForeignFiles) {
  for (const char* file : {"notes.txt",
                           "table.csv",
                           "adam-seed1/table.txt",
                           "results/table.txt"}) {
    const fs::path path = run_ + "/" + file;
    fs::create_directories(path.parent_path());
    std::ofstream(path) << "precious";
    const bool is_in_new_folder = path.parent_path().filename() == "results";
    ExpectRefused(
        kOverwrite, run_, is_in_new_folder ? path.parent_path() : path);
    fs::remove(path);
  }
  fs::remove(run_ + "/results");
  // A link to a folder is not followed.
  fs::create_directories(folder_ / "elsewhere");
  std::ofstream(folder_ / "elsewhere/result.txt") << "precious";
  fs::create_directory_symlink(folder_ / "elsewhere", run_ + "/link");
  ExpectRefused(kOverwrite, run_, run_ + "/link");
}

TEST_F(RunDirectoryOfARun, OverwriteRefusesTheCurrentDirectoryAndItsParents) {
  const fs::path before = fs::current_path();
  fs::current_path(run_ + "/adam-seed1");
  const auto words = "is or contains the current directory";
  ExpectRefused(kOverwrite, run_, words);
  ExpectRefused(kOverwrite, "../../run", words);
  ExpectRefused(kOverwrite, ".", words);
  ExpectRefused(kOverwrite, "..", words);
  ExpectRefused(kOverwrite, "/", words);
  fs::current_path(before);
}

TEST_F(RunDirectoryOfARun, FlagsMustBeOfThisProgram) {
  for (const char* text : {"",
                           "--steps=1\n",
                           "# invgrad\n--steps=1\n",
                           "# invgrad elsewhere\n--steps=1\n"}) {
    std::ofstream(run_ + "/flags.txt") << text;
    ExpectRefused(kOverwrite, run_, "not of a run of this program");
    ExpectRefused(kResume, run_, "not of a run of this program");
  }
  fs::remove(run_ + "/flags.txt");
  ExpectRefused(kOverwrite, run_, "nothing is removed");
}

// At any time between the removal of the old files and the first result.
TEST_F(RunDirectoryOfARun, AKillWhileOverwritingLeavesARunDirectory) {
  std::string error;
  for (const char* missing :
       {"adam-seed1/result.txt", "table.txt", "adam-seed1", "versions.txt"}) {
    fs::remove_all(run_ + "/" + missing);
    std::ofstream(run_ + "/flags.txt.tmp123-4") << "--ste";
    const std::string copy = folder_ / "copy";
    for (const auto existing : {kResume, kOverwrite}) {
      fs::copy(run_, copy, fs::copy_options::recursive);
      EXPECT_TRUE(Prepare(copy, existing, "--steps=1\n", &error))
          << missing << ": " << error;
      EXPECT_FALSE(fs::exists(copy + "/flags.txt.tmp123-4"));
      fs::remove_all(copy);
    }
  }
  // Between the making of a folder and the first file in it.
  for (const auto existing : {kResume, kOverwrite}) {
    fs::create_directories(run_ + "/newton-seed1");
    EXPECT_TRUE(Prepare(run_, existing, "--steps=1\n", &error)) << error;
  }
  EXPECT_FALSE(fs::exists(run_ + "/newton-seed1"));
  // Before the first file.
  fs::remove_all(run_);
  for (const auto existing : {kRefuse, kResume, kOverwrite}) {
    fs::create_directories(run_);
    std::ofstream(run_ + "/flags.txt.tmp123-4") << "--ste";
    EXPECT_TRUE(Prepare(run_, existing, "--steps=1\n", &error)) << error;
    EXPECT_EQ(Snapshot(run_).size(), 3u);
    fs::remove_all(run_);
  }
}

TEST_F(RunDirectoryOfARun, FilesOfKilledWritersAreRemoved) {
  const std::string temporary = run_ + "/adam-seed1/history.csv.tmp77-12";
  const std::string other = run_ + "/adam-seed1/notes.csv.tmp77-12";
  std::string error;
  std::ofstream(temporary) << "step,";
  std::ofstream(other) << "step,";
  EXPECT_TRUE(Prepare(run_, kResume, "--steps=1\n", &error)) << error;
  EXPECT_FALSE(fs::exists(temporary));
  EXPECT_TRUE(fs::exists(other));
  EXPECT_TRUE(fs::exists(run_ + files_[2]));
  fs::remove(other);
  std::ofstream(temporary) << "step,";
  EXPECT_TRUE(Prepare(run_, kOverwrite, "--steps=1\n", &error)) << error;
  EXPECT_EQ(Snapshot(run_).size(), 3u);
}

TEST_F(RunDirectoryOfARun, AnEmptyLineInTheListIsNoFile) {
  std::ofstream(run_ + "/files.txt", std::ios::app) << "\n\n";
  std::ofstream(run_ + "/notes.txt") << "precious";
  std::string error;
  EXPECT_TRUE(Prepare(run_, kResume, "--steps=1\n", &error)) << error;
  EXPECT_TRUE(fs::exists(run_ + "/notes.txt"));
  ExpectRefused(kOverwrite, run_, "notes.txt is not a file of the run");
}

TEST_F(RunDirectoryOfARun, AFileThatCannotBeListedIsNotWritten) {
  fs::remove(run_ + "/files.txt");
  fs::create_directory(run_ + "/files.txt");
  std::string error;
  EXPECT_FALSE(WriteRunFile(run_ + "/new.txt", "result", &error));
  EXPECT_EQ(error,
            "cannot write " + run_ + "/new.txt: it cannot be listed in " +
                run_ + "/files.txt: Is a directory");
  EXPECT_FALSE(fs::exists(run_ + "/new.txt"));
  EXPECT_FALSE(ListRunFile(run_ + "/new.txt", &error));  // again
}

// So that a kill leaves no folder that --overwrite does not know.
TEST_F(RunDirectoryOfARun, TrainingListsItsFilesBeforeItMakesTheirFolder) {
  LearningProblem problem;
  std::string error;
  ASSERT_TRUE(
      CreateLearningProblem("toy_network:num_samples=8", &problem, &error));
  std::vector<Method> methods;
  ASSERT_TRUE(ParseMethods("adam", &methods, &error)) << error;
  LearningRunOptions options;
  options.directory = run_ + "/table.txt/0";  // no folder can be there
  LearningRunResult result;
  EXPECT_FALSE(RunLearning(problem, methods[0], options, &result, &error));
  EXPECT_NE(error.find("Not a directory"), std::string::npos) << error;
  EXPECT_NE(Snapshot(run_)[run_ + "/files.txt"].find("table.txt/0/result.txt"),
            std::string::npos);
}

TEST_F(RunDirectoryOfARun, AnotherIdentityIsNotResumed) {
  RunIdentity identity;
  identity.Add("training data", "1f");
  std::string error;
  ASSERT_TRUE(
      PrepareRunDirectory(run_, kOverwrite, identity, "--steps=1\n", &error));
  const auto before = Snapshot(run_);
  ASSERT_TRUE(
      PrepareRunDirectory(run_, kResume, identity, "--steps=1\n", &error))
      << error;
  RunIdentity other;
  other.Add("training data", "2e");
  EXPECT_FALSE(
      PrepareRunDirectory(run_, kResume, other, "--steps=1\n", &error));
  EXPECT_NE(
      error.find("training data: 1f, now training data: 2e; give another"),
      std::string::npos)
      << error;
  EXPECT_EQ(Snapshot(run_), before);
}

TEST_F(RunDirectoryOfARun, ASmallerBudgetIsNotResumed) {
  std::string error;
  EXPECT_TRUE(Prepare(run_, kResume, "--steps=7\n", &error)) << error;
  for (const char* flags : {"--steps=6\n", "--steps=1\n"}) {
    EXPECT_FALSE(Prepare(run_, kResume, flags, &error));
    EXPECT_NE(error.find("had --steps=7, now it is " + std::string(flags, 9) +
                         ", a smaller budget"),
              std::string::npos)
        << error;
  }
  EXPECT_TRUE(Prepare(run_, kResume, "--steps=0\n", &error)) << error;  // none
  EXPECT_FALSE(Prepare(run_, kResume, "--steps=7\n", &error));
  EXPECT_NE(error.find("had --steps=0, now it is --steps=7, a smaller budget: "
                       "0 is none"),
            std::string::npos)
      << error;
}

}  // namespace run_directory_test
}  // namespace invgrad
