// report.html of each program, as a browser shows it.

#include <signal.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/programs/compare_program.h"
#include "tests/programs/estimate_program.h"
#include "tests/programs/sweep_program.h"
#include "tests/support/browser.h"

namespace invgrad {
namespace html_report_program_test {

// "CURVES,LEFT,SORTED": how many curves there are in all charts, how many are
// left after a click on the first name, and whether two clicks on the title of a
// column of the first table put its greatest number first.
std::string Look(const std::string& html, const std::string& column) {
  EXPECT_LT(html.size(), 2'000'000u);
  return RunInBrowser(
      html,
      "const count = () => document.querySelectorAll('path.curve').length;"
      "const all = count(); document.querySelector('.key').click();"
      "const table = document.querySelector('table.sorts');"
      "const heads = [...table.tHead.rows[0].cells];"
      "const k = heads.findIndex((head) => head.textContent === '" +
          column +
          "');"
          "heads[k].querySelector('button').click();"
          "heads[k].querySelector('button').click();"
          "const cells = [...table.tBodies[0].rows].map("
          "(row) => parseFloat(row.cells[k].textContent));"
          "const is_sorted = cells[0] === Math.max(...cells) && cells[0] > "
          "cells.at(-1);"
          "return [all, count(), is_sorted]");
}

TEST_F(CompareProgram, TheReportOfATrainingRun) {
  INVGRAD_NEED_BROWSER();
  std::vector<std::string> arguments = SmallRun("a<b> & 'c'");
  arguments.push_back("--seeds=1..3");
  const Output output = Run(arguments);
  ASSERT_EQ(output.exit_code, 0) << output.text;
  const std::string html = ReadAll(Path("a<b> & 'c'/report.html"));
  EXPECT_EQ(Look(html, "train loss"), "2,1,true");
  for (const char* part :
       {"compare: oscillator_chain:num_samples=64",
        "has the lowest median test loss",
        "Over 3 seeds their ranges",
        "best first-order method",
        "a&lt;b&gt; &amp; ",
        "<dt>formula</dt>",
        "<dt>budget</dt>\n<dd>3 epochs, each method and seed"}) {
    EXPECT_NE(html.find(part), std::string::npos) << part;
  }
  EXPECT_EQ(html.find("http-equiv=refresh"), std::string::npos);
}

TEST_F(CompareProgram, TheReportOfAPoint) {
  INVGRAD_NEED_BROWSER();
  const Output output = Run({"--problem=heat_state:resolution=8",
                             "--rules=gradient_descent:step_size=1,ceres_bfgs",
                             "--steps=3",
                             "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  const std::string html = ReadAll(Path("run/report.html"));
  EXPECT_EQ(Look(html, "L"), "2,1,true");
  EXPECT_NE(html.find("data:image/png;base64,"), std::string::npos);
}

TEST_F(CompareProgram, TheReportOfAPointHasTheCallsOfASimulatorOfFields) {
  const Output output = Run({"--problem=burgers_initial",
                             "--rules=ceres_lbfgs",
                             "--steps=2",
                             "--plots=false",
                             "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  EXPECT_NE(
      ReadAll(Path("run/report.html")).find("\"x\":\"calls of the simulator\""),
      std::string::npos);
}

TEST_F(CompareProgram, AReportSaysWhichRunIsDamaged) {
  ASSERT_EQ(Run(SmallRun("run")).exit_code, 0);
  std::ofstream(Path("run/half_inverse-seed1/history.csv")) << "step\n1\n";
  std::vector<std::string> arguments = SmallRun("run");
  arguments.push_back("--resume");
  EXPECT_EQ(Run(arguments).exit_code, 2);
  const std::string html = ReadAll(Path("run/report.html"));
  EXPECT_NE(html.find("<li>half_inverse, 1 of 1 seeds: not run: "),
            std::string::npos);
  EXPECT_NE(html.find("history.csv"), std::string::npos);
  EXPECT_NE(html.find("adam has the lowest"), std::string::npos);
}

TEST_F(CompareProgram, TheReportOfARunThatGoesOnAndOfOneThatWasInterrupted) {
  std::vector<std::string> arguments = SmallRun("run");
  arguments[2] = "--seconds=100";
  const pid_t program = Start(arguments);
  const std::string path = Path("run/report.html");
  while (!std::filesystem::exists(path)) usleep(10'000);
  const std::string live = ReadAll(path);
  EXPECT_NE(live.find("0 of 2 runs are done"), std::string::npos);
  EXPECT_NE(live.find("http-equiv=refresh"), std::string::npos);
  EXPECT_EQ(live.find("not run: interrupted"), std::string::npos);
  usleep(300'000);  // until the first step is done
  kill(program, SIGINT);
  EXPECT_EQ(Wait(program).exit_code, 128 + SIGINT);
  const std::string html = ReadAll(path);
  EXPECT_EQ(html.find("http-equiv=refresh"), std::string::npos);
  EXPECT_NE(html.find("<li>adam:step_size=1e-2, 1 of 1 seeds: not run: "
                      "interrupted"),
            std::string::npos);
}

TEST_F(EstimateProgram, TheReportOfEstimations) {
  INVGRAD_NEED_BROWSER();
  const Output output = Run({"--input=" + WriteMisra1a(),
                             "--methods=ceres_lm,ceres_bfgs",
                             "--perturb=0.01",
                             "--seeds=1..3",
                             "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  const std::string html = ReadAll(Path("run/report.html"));
  // A profile and the costs of a start.
  EXPECT_EQ(Look(html, "iterations"), "4,2,true");
  for (const char* part :
       {"reaches the least cost of all methods",
        "of 6 starts",
        "Where the runs ended",
        "performance profile of Dolan",
        "Misra1a-start1-seed1: the start and every result"}) {
    EXPECT_NE(html.find(part), std::string::npos) << part;
  }
}

TEST_F(SweepProgram, TheReportOfASweepAndOfADamagedRun) {
  INVGRAD_NEED_BROWSER();
  const std::vector<std::string> arguments = {
      "--problem=toy_network:num_samples=32",
      "--grid=lambda=1,0.1;batch_size=8,16;rule=half_inverse,adam;seed=1,2",
      "--steps=6",
      "--plots=false",
      "--output=" + Path("run")};
  ASSERT_EQ(Run(arguments).exit_code, 0);
  const std::string html = ReadAll(Path("run/report.html"));
  // Along an axis, curves of a point, and profiles.
  EXPECT_EQ(Look(html, "train loss"), "6,3,true");
  EXPECT_NE(html.find("at 4 of 4 points of the grid"), std::string::npos);
  EXPECT_NE(html.find("Maps over two axes"), std::string::npos);
  std::ofstream(Jobs("run")[0] + "/history.csv") << "step\n1\n";
  EXPECT_EQ(Run(arguments).exit_code, 2);
  const std::string damaged = ReadAll(Path("run/report.html"));
  EXPECT_NE(damaged.find("damaged: "), std::string::npos);
  EXPECT_EQ(Look(damaged, "train loss"), "6,3,true");
}

}  // namespace html_report_program_test
}  // namespace invgrad
