// invgrad as its users get it: installed and moved, by find_package, pkg-config
// and as a Debian package, and as a folder of their own tree. Each way builds
// the application in tests/consumer, or at least finds what that needs.

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "bin/support/ranks.h"
#include "gtest/gtest.h"
#include "invgrad/dense_network.h"
#include "invgrad/npy.h"
#include "invgrad/version.h"
#include "problems/torch/torch_networks.h"
#include "tests/install/public_headers.h"
#include "tests/support/program_runner.h"
#include "tests/support/source_tree.h"

namespace invgrad {
namespace install_program_test {

namespace fs = std::filesystem;

const fs::path kBuild = fs::path(BinDir()).parent_path();

// The variable of that name of the build that is tested.
std::string CacheValue(const std::string& name) {
  std::ifstream cache(kBuild / "CMakeCache.txt");
  for (std::string line; std::getline(cache, line);) {
    if (line.rfind(name + ":", 0) == 0) {
      return line.substr(line.find('=') + 1);
    }
  }
  ADD_FAILURE() << "no " << name << " in CMakeCache.txt";
  return "";
}

std::string Quoted(const std::string& word) { return "'" + word + "'"; }

// Files below `folder`, relative to it, sorted.
std::vector<std::string> Files(const fs::path& folder) {
  std::vector<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) {
      files.push_back(fs::relative(entry.path(), folder).string());
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

class InstallProgram : public ProgramRunner {
 protected:
  InstallProgram() : ProgramRunner("compare") {}

  // Runs a command of the shell, which must succeed; returns what it printed to
  // stdout.
  std::string Shell(const std::string& command) const {
    const std::string out = Path("out");
    const std::string err = Path("err");
    const int status =
        std::system((command + " > " + out + " 2> " + err).c_str());
    EXPECT_EQ(status, 0) << command << "\n" << ReadAll(out) << ReadAll(err);
    return ReadAll(out);
  }

  // cmake --install, elsewhere than where it lies in the end.
  void Install() const {
    Shell(cmake_ + " --install " + Quoted(kBuild) + " --prefix " +
          Path("somewhere"));
    fs::rename(Path("somewhere"), prefix_);
  }

  // The folder of a file of the installed tree.
  fs::path FolderOf(const std::string& name) const {
    for (const std::string& file : Files(prefix_)) {
      if (fs::path(file).filename() == name) {
        return (fs::path(prefix_) / file).parent_path();
      }
    }
    ADD_FAILURE() << "no " << name << " is installed";
    return "";
  }

  // Compiled as the library is (a sanitizer is the whole program's), but
  // quickly.
  std::string Compiler() const {
    return CacheValue("CMAKE_CXX_COMPILER") + " " +
           CacheValue("CMAKE_CXX_FLAGS") + " -O0";
  }

  // Configures tests/consumer into the folder "consumer"; returns the output.
  std::string ConfigureConsumer(const std::string& options) const {
    return Shell(
        cmake_ + " -G " + Quoted(CacheValue("CMAKE_GENERATOR")) + " -S " +
        Quoted(SourceDir() + "/tests/consumer") + " -B " + Path("consumer") +
        " -DCMAKE_CXX_COMPILER=" + Quoted(CacheValue("CMAKE_CXX_COMPILER")) +
        " -DCMAKE_CXX_FLAGS=" + Quoted(CacheValue("CMAKE_CXX_FLAGS") + " -O0") +
        " " + options);
  }

  // "PKG_CONFIG_PATH=... pkg-config"
  std::string PkgConfig() const {
    return "PKG_CONFIG_PATH=" + FolderOf("invgrad.pc").string() + " " +
           CacheValue("PKG_CONFIG_EXECUTABLE");
  }

  // Trains a small network and has the consumer evaluate it.
  void RunConsumer(const std::string& consumer) const {
    const Output trained = Run({"--problem=oscillator_chain",
                                "--hidden=5-7",
                                "--activation=gelu",
                                "--rules=adam:batch_size=256",
                                "--steps=3",
                                "--noplots",
                                "--noprogress",
                                "--output=" + Path("run")});
    ASSERT_EQ(trained.exit_code, 0) << trained.text;
    const DenseNetwork network({4, 5, 7, 24}, Activation::kGelu);
    const Eigen::Vector4d input(0.3, -0.2, 0.7, -1.1);
    Eigen::VectorXd weights;
    std::string error;
    const std::string run = Path("run") + "/adam-batch_size-256-seed1/";
    ASSERT_TRUE(
        ReadNpy(run + "weights.npy", network.num_weights(), &weights, &error))
        << error;
    DenseNetwork::Activations activations;
    network.Forward(weights, input, false, &activations);

    std::istringstream lines(Shell(consumer + " --network=" + run +
                                   "network.txt --input=0.3,-0.2,0.7,-1.1"));
    for (const double expected : activations.outputs.reshaped()) {
      double output = 0.0;
      ASSERT_TRUE(lines >> output);
      // The same code and library: rounding at most, if BLAS adds in another
      // order.
      EXPECT_NEAR(output, expected, 1e-13);
    }
    std::string rest;
    EXPECT_FALSE(lines >> rest) << rest;
  }

  const std::string cmake_ = Quoted(CacheValue("CMAKE_COMMAND"));
  const std::string prefix_ = Path("prefix");
};

TEST_F(InstallProgram, HeadersAreThePublicOnesAndCompile) {
  Install();
  std::vector<std::string> headers;
  for (const std::string& file : Files(fs::path(prefix_) / "include")) {
    if (file.rfind("invgrad/internal/", 0) != 0) headers.push_back(file);
  }
  std::vector<std::string> expected;
  std::string source;
  for (const std::string& header : PublicHeaders()) {
    const bool is_of_torch = header == "torch_network.h";
    if ((is_of_torch && !HasTorch()) || (header == "mpi.h" && !kHasMpi)) {
      continue;
    }
    expected.push_back("invgrad/" + header);
    // It needs libtorch's flags.
    if (!is_of_torch) source += "#include <invgrad/" + header + ">\n";
  }
  EXPECT_EQ(headers, expected);
  std::ofstream(Path("all.cc")) << source;
  Shell(Compiler() + " -std=c++17 -Wall -Wextra -Werror -fsyntax-only $(" +
        PkgConfig() + " --cflags invgrad) " + Path("all.cc"));
}

TEST_F(InstallProgram, FilesHoldNoPathsOfTheBuild) {
  Install();
  int num_read = 0;
  for (const std::string& file : Files(prefix_)) {
    const std::string extension = fs::path(file).extension();
    if (extension != ".cmake" && extension != ".pc") continue;
    const std::string text = ReadAll(prefix_ + "/" + file);
    for (const std::string& path : {SourceDir(), kBuild.string(), Path("")}) {
      EXPECT_EQ(text.find(path), std::string::npos) << path << " in " << file;
    }
    // Nor where this machine keeps its libraries.
    for (const char* library : {"libopenblas.", "liblapacke.", "libceres."}) {
      EXPECT_EQ(text.find(library), std::string::npos) << library << file;
    }
    ++num_read;
  }
  EXPECT_GE(num_read, 5);
}

TEST_F(InstallProgram, FindPackageServesAnApplication) {
  Install();
  const std::string configured =
      ConfigureConsumer("-DCMAKE_PREFIX_PATH=" + prefix_);
  EXPECT_NE(configured.find(HasTorch() ? "with invgrad::torch"
                                       : "without invgrad::torch"),
            std::string::npos)
      << configured;
  EXPECT_NE(
      configured.find(kHasMpi ? "with invgrad::mpi" : "without invgrad::mpi"),
      std::string::npos)
      << configured;
  Shell(cmake_ + " --build " + Path("consumer") + " --target consumer");
  RunConsumer(Path("consumer") + "/consumer");
}

TEST_F(InstallProgram, FindPackageDoesWithoutOptionalComponents) {
  Install();
  const std::string configured =
      ConfigureConsumer("-DCMAKE_PREFIX_PATH=" + prefix_ +
                        " -DCMAKE_DISABLE_FIND_PACKAGE_Torch=ON"
                        " -DCMAKE_DISABLE_FIND_PACKAGE_MPI=ON");
  EXPECT_NE(configured.find("without invgrad::torch"), std::string::npos)
      << configured;
  EXPECT_NE(configured.find("without invgrad::mpi"), std::string::npos)
      << configured;
  EXPECT_NE(configured.find(kHasMpi ? "without invgrad::compare"
                                    : "with invgrad::compare"),
            std::string::npos)
      << configured;
}

// One problem of each kind, and a rule, of a project that is not ours.
TEST_F(InstallProgram, ComparesProblemsOfAnApplication) {
  Install();
  ConfigureConsumer("-DCMAKE_PREFIX_PATH=" + prefix_);
  Shell(cmake_ + " --build " + Path("consumer") + " --target own_compare");
  const std::string program = Path("consumer") + "/own_compare";
  const std::string listing = Shell(program + " --list");
  for (const char* word : {"rosenbrock", "Huber", "rate=1", "sign(gradient)"}) {
    EXPECT_NE(listing.find(word), std::string::npos) << word << listing;
  }
  EXPECT_EQ(listing.find("oscillator_chain"), std::string::npos);
  const auto run = [&](const std::string& problem, const std::string& flags) {
    const std::string output = Path(problem);
    Shell(program + " --noplots --noprogress --problem=" + problem +
          " --output=" + output + " " + flags);
    return ReadAll(output + "/table.txt");
  };
  // From the same flags and seeds, the same run: it goes on where it ended.
  const std::string chain = "--rules=half_inverse,sign --seeds=1,2 ";
  run("chain", chain + "--steps=4");
  const std::string resumed = run("chain", chain + "--steps=8 --resume");
  for (const std::string method : {"half_inverse", "sign"}) {
    EXPECT_NE(resumed.find(method), std::string::npos) << resumed;
    EXPECT_NE(ReadAll(Path("chain") + "/" + method + "-seed2/history.csv")
                  .find("\n8,"),
              std::string::npos);
  }
  const std::string input = run("input", "--rules=ceres_lm,half_inverse");
  EXPECT_NE(input.find("converged"), std::string::npos) << input;
  const std::string decay =
      run("decay", "--rules=gauss_newton:step_size=auto --steps=30");
  EXPECT_NE(decay.find("L2_error"), std::string::npos) << decay;
  const std::string valley = run("rosenbrock", "--seeds=1..3");
  for (const char* word : {"evaluations",
                           "|gradient|",
                           "s to 1e-05",
                           "rosenbrock-seed3",
                           "ceres_dogleg",
                           "ceres_lm+half_inverse",
                           "yes"}) {
    EXPECT_NE(valley.find(word), std::string::npos) << word << valley;
  }
}

// Least-squares problems of a project that is not ours, without any file reader.
TEST_F(InstallProgram, EstimatesByProblemsOfAnApplication) {
  Install();
  ConfigureConsumer("-DCMAKE_PREFIX_PATH=" + prefix_);
  Shell(cmake_ + " --build " + Path("consumer") + " --target own_estimate");
  const std::string program = Path("consumer") + "/own_estimate";
  const std::string listing = Shell(program + " --list");
  EXPECT_NE(listing.find("decay"), std::string::npos) << listing;
  EXPECT_EQ(listing.find("g2o"), std::string::npos) << listing;
  const std::string run = program +
                          " --noplots --noprogress --seeds=1..3 "
                          "--covariance --output=" +
                          Path("own");
  // By default all problems of the program.
  const std::string first = Shell(run);
  for (const char* word : {"decay-seed3", "ceres_lm+geodesic", "2 of 2"}) {
    EXPECT_NE(first.find(word), std::string::npos) << word << first;
  }
  EXPECT_EQ(Shell(run + " --resume"), first);
  const std::string two =
      Shell(program + " --noplots --noprogress --problems=decay,decay:rate=3" +
            " --methods=ceres_lm --output=" + Path("two"));
  EXPECT_NE(two.find("decay-rate-3-seed1"), std::string::npos) << two;
}

// A plugin, a ROS 2 component, a Python module.
TEST_F(InstallProgram, ASharedObjectOfAnApplicationIsLoaded) {
  Install();
  ConfigureConsumer("-DCMAKE_PREFIX_PATH=" + prefix_);
  Shell(cmake_ + " --build " + Path("consumer") +
        " --target plugin load_plugin");
  RunConsumer(Path("consumer") + "/load_plugin " + Path("consumer") +
              "/libplugin.so");
}

TEST_F(InstallProgram, AComponentThatIsWantedMustBeThere) {
  const auto configure = [&](const std::string& options) {
    return std::system(
        (cmake_ + " -G " + Quoted(CacheValue("CMAKE_GENERATOR")) + " -S " +
         Quoted(SourceDir()) + " -B " + Path("library") +
         " -DINVGRAD_BUILD_TESTS=OFF" + " -DINVGRAD_BUILD_PROGRAMS=OFF " +
         " -DCMAKE_DISABLE_FIND_PACKAGE_Torch=ON" +
         " -DCMAKE_DISABLE_FIND_PACKAGE_MPI=ON " + options + " > " +
         Path("out") + " 2> " + Path("err"))
            .c_str());
  };
  EXPECT_NE(configure("-DINVGRAD_WITH_TORCH=ON -DINVGRAD_WITH_MPI=ON"), 0);
  const std::string message = ReadAll(Path("err"));
  for (const char* part : {"Missing: libtorch (for INVGRAD_WITH_TORCH), MPI",
                           "libtorch-dev libopenmpi-dev"}) {
    EXPECT_NE(message.find(part), std::string::npos) << message;
  }
  EXPECT_EQ(configure("-DINVGRAD_WITH_TORCH=AUTO -DINVGRAD_WITH_MPI=OFF"), 0)
      << ReadAll(Path("err"));
}

TEST_F(InstallProgram, PkgConfigServesAnApplication) {
  Install();
  EXPECT_EQ(Shell(PkgConfig() + " --modversion invgrad"), INVGRAD_VERSION "\n");
  Shell(Compiler() + " -std=c++17 " + SourceDir() +
        "/tests/consumer/main.cc -o " + Path("application") + " $(" +
        PkgConfig() + " --cflags --libs invgrad gflags)");
  RunConsumer(Path("application"));
}

// Programs, tests and installation stay off, and the parent's settings alone.
TEST_F(InstallProgram, AddSubdirectoryBringsTheLibraryAlone) {
  ConfigureConsumer("-DINVGRAD_SOURCE_DIR=" + SourceDir());
  const std::string targets =
      Shell(cmake_ + " --build " + Path("consumer") + " --target help");
  EXPECT_NE(targets.find("invgrad"), std::string::npos) << targets;
  for (const char* absent :
       {"compare", "_test", "benchmark", "invgrad_problems", "tutorials"}) {
    EXPECT_EQ(targets.find(absent), std::string::npos) << absent << targets;
  }
  EXPECT_FALSE(fs::exists(Path("consumer") + "/compile_commands.json"));
  Shell(cmake_ + " --install " + Path("consumer") + " --prefix " + prefix_);
  EXPECT_FALSE(fs::exists(prefix_));
}

TEST_F(InstallProgram, DebianPackageHoldsWhatIsInstalled) {
  if (std::system("dpkg-deb --version > /dev/null 2>&1") != 0) {
    GTEST_SKIP() << "needs dpkg-deb";
  }
  Install();
  Shell(CacheValue("CMAKE_CPACK_COMMAND") + " -G DEB --config " +
        Quoted(kBuild / "CPackConfig.cmake") + " -B " + Path("package"));
  std::string package;
  for (const std::string& file : Files(Path("package"))) {
    if (fs::path(file).extension() == ".deb") {
      package = Path("package") + "/" + file;
    }
  }
  const std::string name = fs::path(package).filename();
  EXPECT_EQ(name.rfind("libinvgrad-dev_" INVGRAD_VERSION "_", 0), 0u) << name;
  const std::string fields = Shell("dpkg-deb --field " + package);
  for (const char* field : {"Package: libinvgrad-dev\n",
                            "libceres-dev (>= 2.1)",
                            "libeigen3-dev",
                            "libgoogle-glog-dev",
                            "libopenblas-dev",
                            "liblapacke-dev"}) {
    EXPECT_NE(fields.find(field), std::string::npos) << field << fields;
  }
  Shell("dpkg-deb --extract " + package + " " + Path("root"));
  EXPECT_EQ(Files(Path("root") + "/usr"), Files(prefix_));
  EXPECT_TRUE(
      fs::exists(Path("root") + "/usr/share/doc/libinvgrad-dev/copyright"));
  // A project finds it, wherever it lies.
  ConfigureConsumer("-DCMAKE_PREFIX_PATH=" + Path("root") + "/usr");
}

}  // namespace install_program_test
}  // namespace invgrad
