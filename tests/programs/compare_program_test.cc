// The program compare, run as a user runs it.

#include "tests/programs/compare_program.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "fmt/core.h"
#include "gtest/gtest.h"
#include "invgrad/npy.h"

namespace invgrad {
namespace compare_program_test {

namespace fs = std::filesystem;

TEST_F(CompareProgram, ListsProblemsRulesAndOptions) {
  const Output output = Run({"--list"});
  EXPECT_EQ(output.exit_code, 0);
  for (const char* word : {"squared_component",
                           "linear_scale",
                           "toy_network",
                           "oscillator_chain",
                           "gradient_descent",
                           "adam",
                           "rmsprop",
                           "adagrad",
                           "adadelta",
                           "newton",
                           "saddle_free_newton",
                           "power",
                           "half_inverse",
                           "gauss_newton",
                           "levenberg_marquardt",
                           "krylov",
                           "ceres_lm",
                           "ceres_dogleg",
                           "ceres_bfgs",
                           "ceres_lbfgs",
                           "ceres_nonlinear_cg",
                           "ceres_steepest_descent",
                           "truncation=",
                           "coupling="}) {
    EXPECT_NE(output.text.find(word), std::string::npos) << word;
  }
}

TEST_F(CompareProgram, ShortHelpShowsAllOfAProgramsOwnFlags) {
  const std::vector<std::string> shared = {
      "-hidden ", "-initialization ", "-epochs ", "-seconds ", "-shuffle "};
  for (const char* program : {"compare", "sweep"}) {
    SCOPED_TRACE(program);
    const Output output = Wait(StartProgram(program, {"--helpshort"}));
    ExpectSays(output, shared);
    ExpectSays(output, {"-problem ", "-plots ", "Exit codes: 0 all runs"});
    EXPECT_EQ(output.text.find("-logtostderr "), std::string::npos);
  }
  // Nor those of others.
  const Output output = Wait(StartProgram("trajectories", {"--help"}));
  ExpectSays(output, {"-margin ", "-logtostderr "});
  for (const std::string& flag : shared) {
    EXPECT_EQ(output.text.find("  " + flag), std::string::npos) << flag;
  }
}

TEST_F(CompareProgram, RefusesUnknownNamesAndSuggestsTheNearest) {
  ExpectRefused({"--rules=half_invers"}, {"half_invers", "half_inverse"});
  ExpectRefused({"--rules=adam:stepsize=1"}, {"adam", "stepsize", "step_size"});
  ExpectRefused({"--rules=ceres_lm+adamm"}, {"adamm", "adam"});
  ExpectRefused({"--rules=ceres_lm:truncation=1"}, {"truncation"});
  ExpectRefused({"--problem=oscillator_chains"},
                {"oscillator_chains", "oscillator_chain"});
  ExpectRefused({"--problem=oscillator_chain:couplin=cubic"},
                {"couplin", "coupling"});
}

TEST_F(CompareProgram, RefusesValuesOutOfRange) {
  ExpectRefused({"--rules=adam:step_size=-1"}, {"step_size=-1", "allowed"});
  ExpectRefused({"--rules=adam:step_size=fast"}, {"step_size=fast"});
  ExpectRefused({"--rules=adam,adam"}, {"twice"});
  ExpectRefused({"--rules="}, {"--rules"});
  ExpectRefused({"--epochs=-3"}, {"--epochs=-3", "allowed"});
  ExpectRefused({"--seconds=inf"}, {"--seconds=inf", "allowed"});
  ExpectRefused({"--resume", "--overwrite"}, {"--resume=true", "--overwrite"});
  ExpectRefused({"--batch_size=100000"}, {"--batch_size=100000", "4096"});
  ExpectRefused({"--rules=adam:batch_size=100000"},
                {"batch_size=100000", "4096"});
  ExpectRefused({"--track_sample=4096"}, {"--track_sample=4096", "4095"});
  for (const char* flag :
       {"--seeds=1..3", "--levels=0.1", "--track_sample=3"}) {
    ExpectRefused({"--problem=squared_component", flag}, {flag, "needs a"});
  }
  ExpectRefused({"--problem=more_garbow_hillstrom", "--track_sample=3"},
                {"--track_sample=3 needs a problem with a network"});
  ExpectRefused({"--seeds=1,1"}, {"--seeds", "twice"});
  ExpectRefused({"--seeds=x"}, {"--seeds", "x"});
  ExpectRefused({"--levels=0"}, {"--levels", "0"});
  ExpectRefused({"--problem=oscillator_chain:num_oscillators=1"},
                {"num_oscillators=1", "[2, 16]"});
  ExpectRefused({"--hidden=20-0"}, {"--hidden=20-0", "width=0", "[1, "});
  ExpectRefused({"--activation=sine"}, {"--activation=sine", "one of linear"});
  ExpectRefused({"--initialization=xavier"},
                {"--initialization=xavier", "one of glorot, he, pytorch"});
  ExpectRefused({"stray"}, {"stray"});
}

TEST_F(CompareProgram, RefusesFilesThatDoNotFit) {
  std::string error;
  ExpectRefused({"--init_weights=" + Path("none.npy")}, {"none.npy"});
  std::ofstream(Path("text.npy")) << "no array";
  ExpectRefused({"--init_weights=" + Path("text.npy")}, {"text.npy"});
  ASSERT_TRUE(WriteNpy(
      Path("short.npy"), Eigen::VectorXd(Eigen::VectorXd::Zero(7)), &error));
  ExpectRefused({"--init_weights=" + Path("short.npy")},
                {"short.npy", "7", "1444"});
  // 4-3-24 has 4 * 3 + 3 + 3 * 24 + 24 weights.
  ExpectRefused({"--init_weights=" + Path("short.npy"), "--hidden=3"},
                {"short.npy", "7", "111"});
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(1444);
  weights[7] = std::nan("");
  ASSERT_TRUE(WriteNpy(Path("nan_weights.npy"), weights, &error));
  ExpectRefused({"--init_weights=" + Path("nan_weights.npy")},
                {"nan_weights.npy is not finite: entry 7 is nan"});
  Eigen::MatrixXd data = Eigen::MatrixXd::Constant(64, 4, 0.5);
  data(5, 2) = std::nan("");
  ASSERT_TRUE(WriteNpy(Path("nan.npy"), data, &error));
  ExpectRefused({"--data=" + Path("nan.npy")}, {"nan.npy", "5", "2"});
  ASSERT_TRUE(WriteNpy(
      Path("wide.npy"), Eigen::MatrixXd(Eigen::MatrixXd::Zero(64, 5)), &error));
  ExpectRefused({"--data=" + Path("wide.npy")}, {"(64, 5)", "4"});
}

TEST_F(CompareProgram, WritesARunDirectoryAndRefusesToReplaceIt) {
  const Output output = Run(SmallRun("run"));
  ASSERT_EQ(output.exit_code, 0) << output.text;
  EXPECT_NE(output.text.find("half_inverse"), std::string::npos);
  EXPECT_NE(output.text.find("epochs done"), std::string::npos);
  for (const char* name : {"flags.txt",
                           "versions.txt",
                           "table.txt",
                           "table.md",
                           "summary.csv",
                           "data.npy",
                           "initial_weights-seed1.npy",
                           "half_inverse-seed1/history.csv",
                           "half_inverse-seed1/weights.npy",
                           "half_inverse-seed1/network.txt",
                           "half_inverse-seed1/neurons.csv",
                           "half_inverse-seed1/sample_path.csv",
                           "adam-step_size-1e-2-seed1/weights.npy"}) {
    EXPECT_TRUE(fs::exists(Path("run") + "/" + name)) << name;
  }
  const std::string table = ReadAll(Path("run") + "/table.txt");
  const Output again = Run(SmallRun("run"));
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_NE(again.text.find("exists"), std::string::npos) << again.text;
  EXPECT_EQ(ReadAll(Path("run") + "/table.txt"), table);

  std::vector<std::string> overwrite = SmallRun("run");
  overwrite.push_back("--overwrite");
  EXPECT_EQ(Run(overwrite).exit_code, 0);

  // Only what a run made is ever replaced.
  fs::create_directories(Path("precious"));
  std::ofstream(Path("precious") + "/thesis.tex") << "years";
  overwrite = SmallRun("precious");
  overwrite.push_back("--overwrite");
  EXPECT_EQ(Run(overwrite).exit_code, 1);
  EXPECT_EQ(ReadAll(Path("precious") + "/thesis.tex"), "years");
}

TEST_F(CompareProgram, ADivergingMethodIsARowAndTheOthersGoOn) {
  std::vector<std::string> arguments = SmallRun("run");
  arguments[1] =
      "--rules=gradient_descent:step_size=1e200,half_inverse,"
      "ceres_lm,ceres_lm+half_inverse,ceres_bfgs";
  const Output output = Run(arguments);
  ASSERT_EQ(output.exit_code, 2) << output.text;
  EXPECT_NE(output.text.find("diverged at step 2"), std::string::npos)
      << output.text;
  EXPECT_NE(output.text.find("proposed"), std::string::npos) << output.text;
  EXPECT_TRUE(fs::exists(Path("run") + "/ceres_bfgs-seed1/weights.npy"));
}

TEST_F(CompareProgram, TheExitCodeSaysHowManyMethodsWorked) {
  // A trust region needs a squared norm, which this problem has not.
  for (const char* rules : {"--rules=ceres_lm", "--rules=ceres_lm,adam"}) {
    const Output output = Run({"--problem=quantum_dipole:num_samples=4",
                               rules,
                               "--steps=1",
                               "--plots=false",
                               "--overwrite",
                               "--output=" + Path("run")});
    const bool has_run = std::string(rules) != "--rules=ceres_lm";
    EXPECT_EQ(output.exit_code, has_run ? 2 : 3) << output.text;
    ExpectSays(output, {"not run: a trust region needs"});
    EXPECT_EQ(output.text.find("compare: no run worked") == std::string::npos,
              has_run)
        << output.text;
    EXPECT_TRUE(fs::exists(Path("run") + "/table.txt"));
    const std::string summary = ReadAll(Path("run") + "/summary.csv");
    EXPECT_EQ(summary.rfind("method,seed,", 0), 0u) << summary;
  }
  const Output point = Run({"--problem=squared_component",
                            "--rules=adam:steps=1>newton",
                            "--plots=false",
                            "--output=" + Path("point")});
  EXPECT_EQ(point.exit_code, 3);
  ExpectSays(point, {"no run worked"});
  // A run that diverges has failed.
  const Output diverged = Run({"--problem=toy_network:num_samples=32",
                               "--rules=gradient_descent:step_size=1e200",
                               "--steps=5",
                               "--plots=false",
                               "--output=" + Path("diverged")});
  EXPECT_EQ(diverged.exit_code, 3) << diverged.text;
}

// A line would not be seen.
TEST_F(CompareProgram, NeuronsOfOneEpochAreDrawnAsPoints) {
  std::vector<std::string> arguments = SmallRun("run");
  arguments[2] = "--epochs=1";
  arguments[4] = "--plots";
  ASSERT_EQ(Run(arguments).exit_code, 0);
  const std::string script = ReadAll(Path("run") + "/neurons.gp");
  EXPECT_NE(script.find("array style[120] = [3,3"), std::string::npos);
  EXPECT_NE(script.find("\"layer 3\""), std::string::npos);
}

TEST_F(CompareProgram, FlagsOfTrainingAreRefusedWithoutANetwork) {
  const std::string problem = "--problem=squared_component";
  ExpectRefused({problem, "--rules=adam", "--epochs=5"}, {"--epochs=5"});
  ExpectRefused({problem, "--rules=adam", "--shuffle"}, {"--shuffle"});
  ExpectRefused({problem, "--rules=adam", "--hidden=5"}, {"--hidden=5"});
  ExpectRefused({problem, "--rules=adam", "--steps=3000000000"},
                {"--steps=3000000000", "2147483647"});
}

TEST_F(CompareProgram, BeginsWithAdaptiveWhereNoRulesAreGiven) {
  for (const char* problem : {"toy_network", "squared_component"}) {
    const Output output = Run({std::string("--problem=") + problem,
                               "--steps=1",
                               "--plots=false",
                               "--output=" + Path(problem)});
    EXPECT_EQ(output.exit_code, 0) << output.text;
    const size_t adaptive = output.text.find("\nadaptive ");
    const size_t adam = output.text.find("\nadam:");
    EXPECT_NE(adam, std::string::npos) << output.text;
    EXPECT_LT(adaptive, adam) << output.text;
  }
  // Of 16,384 residuals a step: no rule that decomposes the Jacobian of a batch.
  for (const int num_samples : {128, 129}) {
    const std::string name = fmt::format("fields_{}", num_samples);
    const Output fields = Run(
        {fmt::format("--problem=poisson_inverse:num_samples={}", num_samples),
         "--steps=1",
         "--plots=false",
         "--output=" + Path(name)});
    EXPECT_EQ(fields.exit_code, 0) << fields.text;
    EXPECT_NE(fields.text.find("\nkrylov "), std::string::npos) << fields.text;
    EXPECT_EQ(fields.text.find("\nhalf_inverse "), std::string::npos);
    EXPECT_EQ(fields.text.find("\nadaptive ") != std::string::npos,
              num_samples > 128)
        << fields.text;
  }
}

TEST_F(CompareProgram, PointProblemsHaveATableToo) {
  const std::string rules =
      "--rules=gradient_descent:step_size=0.01,newton,"
      "ceres_lm,ceres_bfgs,ceres_lm+half_inverse";
  const Output output = Run({"--problem=squared_component",
                             rules,
                             "--steps=20",
                             "--plots=false",
                             "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  EXPECT_NE(output.text.find("ceres_bfgs"), std::string::npos);
  EXPECT_TRUE(fs::exists(Path("run") + "/path-newton.csv"));
}

}  // namespace compare_program_test
}  // namespace invgrad
