// Runs a program as a user does: arguments in, exit code and text out. A test
// fixture with a folder of its own, which is removed with all that is in it.
#ifndef INVGRAD_TESTS_SUPPORT_PROGRAM_RUNNER_H_
#define INVGRAD_TESTS_SUPPORT_PROGRAM_RUNNER_H_

#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/source_tree.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {

class ProgramRunner : public ::testing::Test {
 protected:
  struct Output {
    int exit_code = -1;  // -1: ended by a signal
    std::string text;    // stdout and stderr
  };

  // The name of a program in bin/. It chooses the kernels of OpenBLAS itself, and
  // so does not warn of slow ones, which the tests of messages would find.
  explicit ProgramRunner(std::string program) : program_(std::move(program)) {
    ::unsetenv("OPENBLAS_CORETYPE");
  }

  std::string Path(const std::string& name) const { return folder_ / name; }

  static std::string ReadAll(const std::string& path) {
    std::ifstream file(path);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }

  // Starts the program with its output in a file; returns the process.
  pid_t Start(const std::vector<std::string>& arguments) const {
    return StartProgram(program_, arguments);
  }

  // Another program in bin/.
  pid_t StartProgram(const std::string& program,
                     const std::vector<std::string>& arguments) const {
    std::vector<std::string> words = {BinDir() + "/" + program};
    words.insert(words.end(), arguments.begin(), arguments.end());
    return StartCommand(words);
  }

  // Any program; a name without a slash is looked up in PATH.
  pid_t StartCommand(std::vector<std::string> words) const {
    std::vector<char*> argv;
    argv.reserve(words.size() + 1);
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    const pid_t child = ::fork();
    if (child == 0) {
      if (std::freopen(Path("stdout").c_str(), "w", stdout) != nullptr) {
        ::dup2(STDOUT_FILENO, STDERR_FILENO);
        ::execvp(argv[0], argv.data());
      }
      std::_Exit(127);
    }
    return child;
  }

  // Until a program that runs has made the file, for half a minute at most.
  static void WaitForFile(const std::string& path) {
    for (int i = 0; i < 3000 && !std::filesystem::exists(path); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }

  Output Wait(pid_t child) const {
    int status = 0;
    ::waitpid(child, &status, 0);
    Output output;
    output.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    output.text = ReadAll(Path("stdout"));
    return output;
  }

  Output Run(const std::vector<std::string>& arguments) const {
    return Wait(Start(arguments));
  }

  static void ExpectSays(const Output& output,
                         const std::vector<std::string>& words) {
    for (const std::string& word : words) {
      EXPECT_NE(output.text.find(word), std::string::npos)
          << "no '" << word << "' in: " << output.text;
    }
  }

  // Fails with exit code 1, says all of `words`, and writes nothing.
  void ExpectRefused(std::vector<std::string> arguments,
                     const std::vector<std::string>& words) const {
    arguments.push_back("--output=" + Path("refused"));
    const Output output = Run(arguments);
    EXPECT_EQ(output.exit_code, 1) << output.text;
    ExpectSays(output, words);
    EXPECT_FALSE(std::filesystem::exists(Path("refused")));
  }

 private:
  const std::string program_;
  const TemporaryFolder folder_;
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_PROGRAM_RUNNER_H_
