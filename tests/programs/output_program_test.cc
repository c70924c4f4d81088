// What all programs do with their output, and with what nobody expects.

#include <sys/stat.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/address_limit.h"
#include "tests/support/program_runner.h"

namespace invgrad {
namespace output_program_test {

namespace fs = std::filesystem;

class OutputProgram : public ProgramRunner {
 protected:
  OutputProgram() : ProgramRunner("compare") {}

  // The exit code of a command in a shell; {} is the folder of the programs.
  // Its stderr is in the file "stderr".
  int Shell(std::string command) const {
    for (size_t at = 0; (at = command.find("{}")) != std::string::npos;) {
      command.replace(at, 2, BinDir());
    }
    const int status =
        std::system(("bash -c '" + command + "' 2> " + Path("stderr")).c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  // A run that no flag stops.
  std::vector<std::string> SmallRun(const std::string& more) const {
    return {"--problem=toy_network:num_samples=32",
            "--rules=adam",
            "--steps=2",
            "--plots=false",
            "--output=" + Path("run"),
            more};
  }
};

TEST_F(OutputProgram, AFullDeviceIsAnError) {
  for (const char* command : {"{}/compare --list_markdown=rules",
                              "{}/compare --list",
                              "{}/estimate --list",
                              "{}/sweep --help",
                              "{}/compare --helpshort",
                              "{}/bench --benchmark_list_tests"}) {
    SCOPED_TRACE(command);
    EXPECT_EQ(Shell(std::string(command) + " > /dev/full"), 1);
    const std::string error = ReadAll(Path("stderr"));
    EXPECT_NE(error.find(": cannot write the output"), std::string::npos)
        << error;
  }
}

TEST_F(OutputProgram, AReaderThatEndsIsNoError) {
  // The text is longer than a pipe holds.
  EXPECT_EQ(Shell("for i in 1 2 3 4; do {}/compare --list; done | head -n 1 "
                  "> /dev/null"),
            0);
  EXPECT_EQ(ReadAll(Path("stderr")), "");
}

TEST_F(OutputProgram, LongNamesAreCut) {
  // A rule whose settings take more bytes than the name of a file may have.
  const std::string digits(260, '0');
  std::vector<std::string> arguments = SmallRun("--progress=false");
  arguments[1] = "--rules=adam:step_size=0.001" + digits;
  const Output output = Run(arguments);
  EXPECT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"steps done"});
}

TEST_F(OutputProgram, PathsThatTheSystemRefusesAreMessages) {
  fs::create_symlink("loop", Path("loop"));
  for (const std::string& path :
       {std::string(300, 'x'), Path("loop"), Path("loop") + "/x"}) {
    const std::string reason =
        path[0] == 'x' ? "File name too long" : "Too many levels";
    for (const char* flag : {"--output=", "--data=", "--init_weights="}) {
      SCOPED_TRACE(flag + path);
      const Output output = Run(SmallRun(flag + path));
      EXPECT_EQ(output.exit_code, 1) << output.text;
      const std::string name(flag, std::strlen(flag) - 1);
      ExpectSays(output, {"compare: " + name + ": ", reason});
      EXPECT_EQ(output.text.find("terminate called"), std::string::npos);
    }
  }
}

TEST_F(OutputProgram, PipesAndDevicesAreNoInput) {
  ASSERT_EQ(mkfifo(Path("pipe").c_str(), 0600), 0);
  ASSERT_EQ(mkfifo(Path("pipe.g2o").c_str(), 0600), 0);
  for (const std::string& path : {Path("pipe"), std::string("/dev/zero")}) {
    for (const char* flag : {"--data=", "--init_weights="}) {
      ExpectRefused({"--problem=toy_network", flag + path},
                    {std::string(flag, std::strlen(flag) - 1) +
                     ": cannot read " + path + ": not a regular file"});
    }
    ExpectRefused({"--flagfile=" + path}, {"--flagfile: cannot read " + path});
    ExpectRefused({"--flagfile", path}, {"--flagfile: cannot read " + path});
  }
  const Output output =
      Wait(StartProgram("estimate", {"--input=" + Path("pipe.g2o")}));
  EXPECT_EQ(output.exit_code, 1);
  ExpectSays(output, {"--input: ", "pipe.g2o: not a regular file"});
}

TEST_F(OutputProgram, WhatIsEchoedIsShortAndPrintable) {
  const std::string escape = "\x1b[31mred\a";
  const std::string large(100000, 'x');
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"--rules=adam:" + escape + "=1", "has a control character"},
      {"--" + escape, "has a control character"},
      {escape, "has a control character"},
      {"--rules=" + large, "unknown rule 'xxx"},
      {"--rules=adam:step_size=" + large, "is not a finite number"},
      {"--rules=adam:" + large + "=1", "unknown option 'xxx"},
      {"--problem=" + large, "--problem: unknown problem 'xxx"},
      {"--output=" + large, "File name too long"},
      {"--init_weights=" + large, "File name too long"},
      {"--flagfile=" + large, "File name too long"},
      {"--hidden=" + large, "hidden=xxx"},
      {"--seeds=" + large, "seed=xxx"},
      {"--" + large, "too long for a flag without text"},
      {"--steps=" + std::string(100000, '1'), "too long for a flag without"},
      {large, "unexpected argument 'xxx"}};
  for (const auto& [argument, message] : cases) {
    SCOPED_TRACE(argument.substr(0, 40));
    const Output output = Run(SmallRun(argument));
    EXPECT_EQ(output.exit_code, 1);
    EXPECT_LT(output.text.size(), 5000u);
    EXPECT_EQ(output.text.find_first_of("\x1b\a"), std::string::npos);
    ExpectSays(output, {message});
  }
}

TEST_F(OutputProgram, AValueBesideItsFlagIsEchoedShortToo) {
  const std::string large(100000, '1');
  for (const auto& [flag, message] :
       {std::pair("--steps", "too long for a flag without text"),
        std::pair("--seconds", "too long for a flag without text"),
        std::pair("--rules", "unknown rule '111")}) {
    SCOPED_TRACE(flag);
    std::vector<std::string> arguments = SmallRun(flag);
    arguments.push_back(large);
    const Output output = Run(arguments);
    EXPECT_EQ(output.exit_code, 1);
    EXPECT_LT(output.text.size(), 5000u);
    ExpectSays(output, {message});
  }
}

TEST_F(OutputProgram, NumbersThatDoNotFitAreOutOfRange) {
  ExpectRefused({"--seeds=2147483648"},
                {"seed=2147483648 is out of the range of 32 bits; allowed: "
                 "integer in [0, "});
  ExpectRefused({"--rules=krylov:iterations=2147483648"},
                {"iterations=2147483648 is out of the range of 32 bits"});
  ExpectRefused({"--rules=adam:step_size=1e999"},
                {"step_size=1e999 is out of a double's range"});
}

TEST_F(OutputProgram, PathsThatDoNotFitAreRefused) {
  if (!kCanLimitAddresses) GTEST_SKIP() << "under a sanitizer";
  for (const std::string program :
       {"trajectories", "compare --problem=squared_component"}) {
    EXPECT_EQ(Shell("ulimit -v 4000000; {}/" + program +
                    " --steps=2147483647 --output=" + Path("refused")),
              1);
    const std::string error = ReadAll(Path("stderr"));
    EXPECT_NE(error.find("--steps=2147483647 needs "), std::string::npos);
    EXPECT_NE(error.find("B for the paths; the limit is 3.07 GB"),
              std::string::npos)
        << error;
    EXPECT_FALSE(fs::exists(Path("refused")));
  }
}

TEST_F(OutputProgram, ASignalEndsAPathAndKeepsIt) {
  const pid_t child = Start({"--problem=squared_component",
                             "--rules=gradient_descent:step_size=1e-9,newton",
                             "--steps=5000000",
                             "--plots=false",
                             "--output=" + Path("run")});
  WaitForFile(Path("run/versions.txt"));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  ::kill(child, SIGHUP);
  const Output output = Wait(child);
  EXPECT_EQ(output.exit_code, 128 + SIGHUP) << output.text;
  ExpectSays(output, {"ending after the current step", "not run: interrupted"});
  EXPECT_TRUE(fs::exists(Path("run/path-gradient_descent-step_size-1e-9.csv")));
  EXPECT_TRUE(fs::exists(Path("run/table.txt")));
}

// Estimates of more bytes than a file may have.
TEST_F(OutputProgram, EstimatesThatCannotBeWrittenAreAFailure) {
  std::ofstream graph(Path("chain.g2o"));
  for (int i = 0; i < 500; ++i) {
    graph << "VERTEX_SE2 " << i << " 0.1 0.1 0.1\n";
    if (i > 0) {
      graph << "EDGE_SE2 " << i - 1 << " " << i << " 1 0 0 1 0 0 1 0 1\n";
    }
  }
  graph.close();
  EXPECT_EQ(Shell("ulimit -f 8; trap \"\" XFSZ; {}/estimate --plots=false "
                  "--methods=ceres_lm --max_iterations=2 --input=" +
                  Path("chain.g2o") + " --output=" + Path("run") + " >&2"),
            3);
  const std::string text = ReadAll(Path("stderr"));
  EXPECT_NE(text.find("no result file: cannot write "), std::string::npos)
      << text;
  EXPECT_NE(text.find("File too large"), std::string::npos) << text;
  EXPECT_FALSE(fs::exists(Path("run/chain/ceres_lm.g2o")));
  EXPECT_TRUE(fs::exists(Path("run/table.txt")));
}

// In less address space than the file has bytes.
TEST_F(OutputProgram, ALargeFileIsRefusedAndNotAllocated) {
  if (!kCanLimitAddresses) GTEST_SKIP() << "under a sanitizer";
  std::ofstream(Path("x.npy")) << "VERTEX_SE2 0 0 0 0\n";
  fs::resize_file(Path("x.npy"), std::uintmax_t{6} << 30);  // sparse
  EXPECT_EQ(Shell("ulimit -v 4000000; {}/compare --problem=toy_network "
                  "--init_weights=" +
                  Path("x.npy")),
            1);
  EXPECT_NE(ReadAll(Path("stderr")).find("not a .npy file"), std::string::npos);
  fs::rename(Path("x.npy"), Path("x.g2o"));
  EXPECT_EQ(Shell("ulimit -v 4000000; {}/estimate --input=" + Path("x.g2o")),
            1);
  EXPECT_NE(ReadAll(Path("stderr"))
                .find("x.g2o: it needs 6.44 GB for its "
                      "bytes; the limit is 3.07 GB"),
            std::string::npos)
      << ReadAll(Path("stderr"));
}

}  // namespace output_program_test
}  // namespace invgrad
