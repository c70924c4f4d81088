// The program sweep, run as a user runs it.

#include "tests/programs/sweep_program.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "gtest/gtest.h"

namespace invgrad {
namespace sweep_program_test {

namespace fs = std::filesystem;

TEST_F(SweepProgram, SaysWhatIsWrongWithAGrid) {
  const auto expect = [this](const std::string& grid,
                             const std::vector<std::string>& words) {
    ExpectRefused({"--problem=toy_network", "--grid=" + grid}, words);
  };
  expect("", {"--grid is missing", "--grid=\"rule=half_inverse,adam"});
  expect("lambda=1,;rule=adam", {"--grid: the axis 'lambda' has an empty"});
  expect("lambda=1", {"rule=method"});
  expect("lamda=1;rule=adam", {"'lamda'", "lambda"});
  expect("rule=adam;stepsize=1", {"'stepsize'", "step_size"});
  expect("rule=newton/numerical/adam;y_stepsize=1",
         {"'y_stepsize'", "y_step_size"});
  expect("rule=adam:epochs=1>", {"--grid: ", "adam:epochs=1>"});
  expect("rule=adam>half_inverse", {"'adam' needs epochs=N"});
  expect("hidden=9,9-;rule=adam", {"hidden=9-", "20-20-20"});
  expect("activation=sine;rule=adam", {"activation=sine"});
  expect("rule=adm", {"'adm'", "adam"});
  expect("rule=adam:step_size=1|-2", {"step_size=-2", "allowed"});
  expect("rule=adam;step_size=-1", {"step_size=-1", "allowed"});
  expect("rule=adam:step_size=1;step_size=2", {"given twice: 1 and 2"});
  expect("rule=adam;lambda=1,-3", {"lambda=-3", "allowed"});
  expect("rule=adam;seed=1,x", {"seed=x"});
  expect("rule=adam;batch_size=4,1000000",
         {"batch_size=1000000", "training samples"});
}

TEST_F(SweepProgram, RefusesOtherFlagsOutOfRange) {
  const std::string grid = "--grid=rule=adam";
  const std::string problem = "--problem=toy_network";
  ExpectRefused({"--problem=toy_net", grid}, {"toy_net"});
  ExpectRefused({"--problem=squared_component", grid, "--steps=3000000000"},
                {"--steps=3000000000", "2147483647"});
  ExpectRefused({"--problem=squared_component", grid, "--epochs=3"},
                {"--epochs=3 needs a problem with a network"});
  ExpectRefused({"--problem=squared_component", "--grid=rule=adam;hidden=3"},
                {"'hidden'"});
  ExpectRefused({problem, grid, "--job=1"}, {"--job=1", "[-1, 0]"});
  ExpectRefused({problem, grid, "--job=0", "--collect"}, {"one of them"});
  // It writes into no other directory than that of the runs.
  ExpectRefused({problem, grid, "--collect"}, {"--output", "No such file"});
  ExpectRefused({problem, grid, "--tail=1"}, {"--tail=1", "[0, 1)"});
  ExpectRefused({problem, grid, "--seconds=-1"}, {"--seconds=-1"});
  ExpectRefused({problem, grid, "--value=test_loss"},
                {"--value=test_loss", "auto, train_loss\n"});
  ExpectRefused({problem, grid, "--value=accuracy"}, {"--value=accuracy"});
}

TEST_F(SweepProgram, HasARowForEveryRunAndTheBestIsMarked) {
  const Output output = Run(SmallSweep("run"));
  ASSERT_EQ(output.exit_code, kSomeFailed) << output.text;
  const CsvLines rows = Results("run");
  ASSERT_EQ(rows.size(), 8u);
  for (const auto& row : rows) EXPECT_EQ(row.at("seed"), "1");
  EXPECT_EQ(rows[0].at("lambda"), "1");
  EXPECT_EQ(rows[0].at("rule"), "half_inverse");
  EXPECT_EQ(rows[0].at("best"), "1");
  EXPECT_EQ(rows[0].at("steps"), "6");
  EXPECT_EQ(rows[7].at("lambda"), "0.1");
  EXPECT_EQ(rows[7].at("alternative"), "step_size=1e200");
  EXPECT_EQ(rows[7].at("status").substr(0, 8), "diverged");
  for (const int first : {1, 5}) {  // of three step sizes
    const double small = std::stod(rows[first].at("train_loss"));
    const double large = std::stod(rows[first + 1].at("train_loss"));
    // In six steps the larger step gets farther; it is inside of its grid, the
    // smaller one would not be.
    ASSERT_LT(large, small);
    EXPECT_EQ(rows[first].at("best"), "0");
    EXPECT_EQ(rows[first + 1].at("best"), "1");
    EXPECT_EQ(rows[first + 1].at("at_edge"), "");
    EXPECT_EQ(rows[first + 2].at("best"), "0");
  }
  const std::string table = ReadAll(Path("run") + "/table.txt");
  EXPECT_NE(table.find("adam:step_size=3e-2"), std::string::npos) << table;
  EXPECT_EQ(table.find("adam:step_size=1e-3"), std::string::npos) << table;
  EXPECT_TRUE(fs::exists(Path("run") + "/table.md"));
}

TEST_F(SweepProgram, TheEdgeOfAGridIsReported) {
  std::vector<std::string> arguments = SmallSweep("run");
  arguments[1] = "--grid=rule=adam:step_size=1e-3|1e-2|3e-2";
  ASSERT_EQ(Run(arguments).exit_code, 0);
  const CsvLines rows = Results("run");
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[2].at("best"), "1");
  EXPECT_EQ(rows[2].at("at_edge"), "step_size");
}

TEST_F(SweepProgram, RunsAreThoseOfCompare) {
  ASSERT_EQ(Run(SmallSweep("run")).exit_code, kSomeFailed);
  const Output compared = Wait(StartProgram(
      "compare",
      {"--problem=toy_network:num_samples=32:lambda=0.1",
       "--rules=half_inverse,adam:step_size=1e-3,adam:step_size=3e-2",
       "--steps=6",
       "--plots=false",
       "--output=" + Path("compare")}));
  ASSERT_EQ(compared.exit_code, 0) << compared.text;
  const CsvLines wanted = ReadCsv(ReadAll(Path("compare") + "/summary.csv"));
  const CsvLines rows = Results("run");
  ASSERT_EQ(wanted.size(), 3u);
  for (int i = 0; i < 3; ++i) {
    for (const char* name :
         {"train_loss", "best_train_loss", "steps", "status"}) {
      EXPECT_EQ(rows[4 + i].at(name), wanted[i].at(name)) << name;
    }
  }
}

TEST_F(SweepProgram, AFlagFileMayListJobs) {
  const std::string file = Path("flags");
  std::ofstream(file) << "--list_jobs\n--steps=2\n--noplots\n";
  const Output list = Run({"--flagfile=" + file,
                           "--problem=toy_network:num_samples=32",
                           "--grid=rule=adam",
                           "--output=" + Path("run")});
  ASSERT_EQ(list.exit_code, 0) << list.text;
  std::ofstream(Path("jobs")) << list.text;
  const Output job = Wait(StartCommand({"sh", Path("jobs")}));
  EXPECT_EQ(job.exit_code, 0) << job.text;
}

// As a shell, xargs or GNU parallel runs the lines.
TEST_F(SweepProgram, AListOfJobsInAnyOrderGivesTheSameResults) {
  ASSERT_EQ(Run(SmallSweep("row")).exit_code, kSomeFailed);
  std::vector<std::string> arguments = SmallSweep("list");
  arguments.push_back("--list_jobs");
  const Output list = Run(arguments);
  ASSERT_EQ(list.exit_code, 0) << list.text;
  EXPECT_FALSE(fs::exists(Path("list") + "/jobs"));
  std::istringstream text(list.text);
  std::vector<std::string> jobs;
  for (std::string job; std::getline(text, job);) jobs.push_back(job);
  ASSERT_EQ(jobs.size(), 8u);
  arguments.back() = "--collect";
  const Output none = Run(arguments);
  EXPECT_EQ(none.exit_code, 3) << none.text;
  EXPECT_EQ(Results("list")[0].at("status"), "not run");
  std::ofstream(Path("jobs"))
      << jobs[7] << '\n'
      << jobs[1] << " & " << jobs[2] << " & " << jobs[0] << " & wait\n"
      << jobs[3] << "\nfalse || " << jobs[1];
  const Output some = Wait(StartCommand({"sh", Path("jobs")}));
  EXPECT_EQ(some.exit_code, 0) << some.text;
  ExpectSays(some, {"7-lambda-0.1-adam-step_size-1e200", "diverged"});
  // What the others did is there, and is not done again.
  const Output rest = Run(SmallSweep("list"));
  EXPECT_EQ(rest.exit_code, kSomeFailed) << rest.text;
  ExpectSays(rest, {"5 of 8 runs were done before"});
  EXPECT_EQ(Losses("list"), Losses("row"));
  arguments.back() = "--collect";
  EXPECT_EQ(Run(arguments).exit_code, kSomeFailed);
  EXPECT_EQ(Losses("list"), Losses("row"));
  EXPECT_EQ(ReadAll(Path("list") + "/files.txt").size(),
            ReadAll(Path("row") + "/files.txt").size());
  // A job of another sweep is refused.
  arguments[2] = "--steps=5";
  arguments.back() = "--job=0";
  const Output other = Run(arguments);
  EXPECT_EQ(other.exit_code, 1);
  ExpectSays(other, {"now it is --steps=5, a smaller budget"});
}

TEST_F(SweepProgram, GoesOnWithWhatIsMissing) {
  ASSERT_EQ(Run(SmallSweep("run")).exit_code, kSomeFailed);
  const CsvLines before = Results("run");
  const std::vector<std::string> jobs = Jobs("run");
  ASSERT_EQ(jobs.size(), 8u);
  std::vector<fs::file_time_type> times;
  times.reserve(jobs.size());
  for (const std::string& job : jobs) {
    times.push_back(fs::last_write_time(job + "/history.csv"));
  }
  fs::remove_all(jobs[3]);
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  const Output output = Run(SmallSweep("run"));
  ASSERT_EQ(output.exit_code, kSomeFailed) << output.text;
  EXPECT_NE(output.text.find("7 of 8 runs were done before"), std::string::npos)
      << output.text;
  for (size_t i = 0; i < jobs.size(); ++i) {
    const bool is_new =
        fs::last_write_time(jobs[i] + "/history.csv") > times[i];
    EXPECT_EQ(is_new, i == 3) << jobs[i];
  }
  const CsvLines after = Results("run");
  int num_times_changed = 0;
  for (size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(after[i].at("train_loss"), before[i].at("train_loss"));
    num_times_changed += after[i].at("seconds") != before[i].at("seconds");
  }
  EXPECT_LE(num_times_changed, 1);

  // A larger budget goes on with all runs, but the two that diverged.
  std::vector<std::string> longer = SmallSweep("run");
  longer[2] = "--steps=9";
  const Output more = Run(longer);
  EXPECT_NE(more.text.find("2 of 8 runs were done before"), std::string::npos)
      << more.text;
  longer.back() = "--output=" + Path("whole");
  ASSERT_EQ(Run(longer).exit_code, kSomeFailed);
  EXPECT_EQ(Losses("run"), Losses("whole"));

  // Another grid is another sweep.
  std::vector<std::string> other = SmallSweep("run");
  other[1] += ",2";
  const Output refused = Run(other);
  EXPECT_EQ(refused.exit_code, 1);
  ExpectSays(refused, {"--grid=", "give another --output, or --overwrite"});
  EXPECT_EQ(Jobs("run"), jobs);
  other.push_back("--overwrite");
  EXPECT_EQ(Run(other).exit_code, kSomeFailed);
  EXPECT_EQ(Results("run").size(), 16u);
}

TEST_F(SweepProgram, ADamagedRunIsARowAndTheOthersGoOn) {
  std::vector<std::string> arguments = SmallSweep("run");
  arguments[1] = "--grid=rule=adam,rmsprop,half_inverse;seed=1";
  ASSERT_EQ(Run(arguments).exit_code, 0);
  const std::string damaged = Jobs("run")[1] + "/result.txt";
  const std::string text = ReadAll(damaged).substr(7);
  std::ofstream(damaged) << text;
  arguments[2] = "--steps=9";
  const Output output = Run(arguments);
  EXPECT_EQ(output.exit_code, kSomeFailed) << output.text;
  ExpectSays(output, {"damaged: " + damaged + ": not a result of a run"});
  const CsvLines rows = Results("run");
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[0].at("steps"), "9");
  EXPECT_EQ(rows[1].at("steps"), "");
  EXPECT_EQ(rows[2].at("steps"), "9");
  EXPECT_EQ(ReadAll(damaged), text);
}

TEST_F(SweepProgram, InterruptKeepsWhatIsComplete) {
  std::vector<std::string> arguments = SmallSweep("run");
  // The first rule diverges at once, the second has no end.
  arguments[1] =
      "--grid=rule=gradient_descent:step_size=1e200,adam,rmsprop;seed=1";
  arguments[2] = "--steps=1000000000";
  const pid_t child = Start(arguments);
  const std::string endless = Path("run") + "/jobs/1-adam-batch32-seed1";
  WaitForFile(endless);
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  ::kill(child, SIGINT);
  const Output output = Wait(child);
  EXPECT_EQ(output.exit_code, 128 + SIGINT) << output.text;
  const std::string notice = "ending after the current step";
  EXPECT_NE(output.text.find(notice), std::string::npos);
  EXPECT_EQ(output.text.find(notice), output.text.rfind(notice));  // no job's
  const CsvLines rows = Results("run");
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[0].at("status").substr(0, 8), "diverged");
  EXPECT_EQ(rows[1].at("status"), "interrupted");
  EXPECT_EQ(rows[2].at("status"), "interrupted");
  EXPECT_TRUE(fs::exists(endless + "/checkpoint"));
  EXPECT_FALSE(fs::exists(endless + "/result.txt"));

  arguments[2] = "--steps=1";  // fewer than there were
  const Output refused = Run(arguments);
  EXPECT_EQ(refused.exit_code, 1);
  ExpectSays(refused, {"now it is --steps=1, a smaller budget"});
}

TEST_F(SweepProgram, ARuleThatCannotTakeTheProblemIsARow) {
  const Output output = Run({"--problem=quantum_dipole:num_samples=4",
                             "--grid=rule=ceres_lm,adam",
                             "--steps=1",
                             "--plots=false",
                             "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, kSomeFailed) << output.text;
  const std::string csv = ReadAll(Path("run") + "/sweep.csv");
  EXPECT_NE(csv.find("not run: a trust region needs"), std::string::npos)
      << csv;
  EXPECT_NE(csv.find("steps done"), std::string::npos) << csv;
  const Output none = Run({"--problem=quantum_dipole:num_samples=4",
                           "--grid=rule=ceres_lm",
                           "--steps=1",
                           "--plots=false",
                           "--output=" + Path("none")});
  EXPECT_EQ(none.exit_code, 3) << none.text;
  ExpectSays(none, {"sweep: no run worked"});
}

TEST_F(SweepProgram, DrawsLinesMapsAndCurves) {
  if (std::system("gnuplot --version > /dev/null 2>&1") != 0) {
    GTEST_SKIP() << "gnuplot is not installed (apt install gnuplot-nox)";
  }
  std::vector<std::string> arguments = SmallSweep("run");
  arguments[1] = "--grid=lambda=1,0.1;rule=adam;batch_size=4,8";
  arguments[3] = "--plots";
  const Output output = Run(arguments);
  ASSERT_EQ(output.exit_code, 0) << output.text;
  EXPECT_EQ(output.text.find("panels"), std::string::npos) << output.text;
  for (const char* name : {"lines.png", "heat_map.png", "curves.png"}) {
    EXPECT_TRUE(fs::exists(Path("run") + "/" + name)) << name;
  }
}

// A minimizer, a rule with alternatives and a problem's option, from two starts.
TEST_F(SweepProgram, GoesOverALeastSquaresProblem) {
  const std::vector<std::string> flags = {
      "--problem=more_garbow_hillstrom:spread=0.1",
      std::string("--grid=function=bard,beale;seed=1,2;") +
          "rule=ceres_lm,half_inverse:step_size=auto:truncation=1e-12|1e-3",
      "--steps=60",
      "--noplots",
      "--noprogress",
      "--output=" + Path("run")};
  const Output output = Run(flags);
  ASSERT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"cost", "all seeds"});
  const CsvLines rows = Results("run");
  ASSERT_EQ(rows.size(), 12u);
  for (const auto& row : rows) {
    if (row.at("rule") != "ceres_lm") continue;
    // The published sum of squares of bard; beale has the solution 0.
    const double least = row.at("function") == "bard" ? 4.107435e-3 : 0.0;
    EXPECT_NEAR(std::stod(row.at("train_loss")), least, 5e-9);
  }
  // The same command reads what is done, its times among it.
  const Output again = Run(flags);
  EXPECT_EQ(again.exit_code, 0) << again.text;
  ExpectSays(again, {"12 of 12 runs were done before"});
  EXPECT_EQ(Results("run"), rows);
}

TEST_F(SweepProgram, GoesOverAPointProblem) {
  const Output output =
      Run({"--problem=squared_component",
           "--grid=rule=gradient_descent;step_size=0.001,0.01,0.02",
           "--steps=10",
           "--noplots",
           "--noprogress",
           "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  const CsvLines rows = Results("run");
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_LT(std::stod(rows[1].at("train_loss")),
            std::stod(rows[0].at("train_loss")));
  for (const auto& row : rows) EXPECT_EQ(row.at("steps"), "10");
}

}  // namespace sweep_program_test
}  // namespace invgrad
