#include "report/plot.h"

#include <cstdlib>
#include <filesystem>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "report/interrupt.h"
#include "tests/report/plot_test_fixture.h"

namespace invgrad {
namespace plot_test {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A PNG by the gnuplot that is installed.
class DrawnPlotTest : public PlotTest {
 protected:
  void SetUp() override {
    if (std::system("gnuplot --version > /dev/null 2>&1") != 0) {
      GTEST_SKIP() << "gnuplot is not installed (apt install gnuplot-nox)";
    }
  }
};

TEST_F(DrawnPlotTest, LinesPointsBandsAndContoursAreDrawn) {
  Plot plot;
  plot.title = "title";
  plot.log_y = true;
  plot.series = {Line({1, 2, 3}, {1e-3, 1e-6, 1e-9})};
  EXPECT_EQ(Draw({plot}, "line"), std::make_pair(1200, 800));
  plot.series[0].style = Series::Style::kPoints;
  EXPECT_EQ(Draw({plot}, "points"), std::make_pair(1200, 800));
  plot.series[0].style = Series::Style::kLines;
  plot.series[0].y_low = {1e-4, 0.0, kNan};
  plot.series[0].y_high = {1e-2, 1e-5, kInfinity};
  EXPECT_EQ(Draw({plot}, "band"), std::make_pair(1200, 800));
  plot.log_y = false;
  ContourField field;
  field.x = {0, 2, 4};
  field.y = {0, 1, 2, 3};
  field.z = Eigen::MatrixXd::Random(4, 3);
  field.z(0, 0) = kNan;
  plot.contours = field;
  EXPECT_EQ(Draw({plot}, "contours"), std::make_pair(1200, 800));
  // Each of them leaves other pixels.
  EXPECT_NE(Read(folder_ / "line.png"), Read(folder_ / "points.png"));
  EXPECT_NE(Read(folder_ / "line.png"), Read(folder_ / "band.png"));
  plot.contours->z.setZero();
  Draw({plot}, "flat");
  EXPECT_NE(Read(folder_ / "contours.png"), Read(folder_ / "flat.png"));
}

TEST_F(DrawnPlotTest, PanelsStandSideBySideOrInRows) {
  Plot plot;
  plot.series = {Line({1, 2, 3}, {1, 2, 3})};
  plot.series[0].title.clear();
  const auto size = [&](int num_panels) {
    return Draw(std::vector<Plot>(num_panels, plot));
  };
  constexpr int kWidth = 115 + 480 + 35;
  EXPECT_EQ(size(3), std::make_pair(3 * (115 + 640 + 35), 700));
  EXPECT_EQ(size(4), std::make_pair(2 * kWidth, 2 * 540));
  EXPECT_EQ(size(5), std::make_pair(3 * kWidth, 2 * 540));
  EXPECT_EQ(size(24), std::make_pair(4 * kWidth, 6 * 540));
}

TEST_F(DrawnPlotTest, RowsMayHaveAGivenLengthAndEmptyPlaces) {
  Plot plot;
  plot.series = {Line({1, 2, 3}, {1, 2, 3})};
  plot.series[0].title.clear();
  const std::vector<Plot> five(5, plot);
  constexpr int kWidth = 115 + 480 + 35;
  EXPECT_EQ(Draw(five, "two", 2), std::make_pair(2 * kWidth, 3 * 540));
  EXPECT_EQ(Draw(five, "five", 5), std::make_pair(5 * 790, 700));
  // An empty place is as large as a panel, and has no axes.
  EXPECT_EQ(Draw({plot, Plot(), plot, plot}, "gap", 2),
            std::make_pair(2 * kWidth, 2 * 540));
  const std::string script = Read(folder_ / "gap.gp");
  EXPECT_TRUE(Has(script, "set multiplot next"));
  EXPECT_FALSE(Has(script, "$panel1"));
}

TEST_F(DrawnPlotTest, HeatMapsHaveAColorBarAndBlankCells) {
  Plot plot;
  plot.heat_map.emplace().z = Eigen::MatrixXd::Random(2, 3);
  EXPECT_EQ(Draw({plot}, "alone"), std::make_pair(1200, 800));
  plot.heat_map->z(1, 1) = kNan;
  Draw({plot}, "blank");
  EXPECT_NE(Read(folder_ / "alone.png"), Read(folder_ / "blank.png"));
  // Beside another one, a panel is wider by its bar; alone, its axes shrink.
  EXPECT_EQ(Draw({plot, plot}, "two"),
            std::make_pair(2 * (115 + 640 + 122 + 35), 700));
  plot.heat_map->z.setConstant(kNan);
  EXPECT_EQ(Draw({plot}, "empty"), std::make_pair(1200, 800));
  for (const double constant : {0.0, 1e-300, -3.0}) {
    for (const bool is_log : {false, true}) {
      plot.heat_map->z.setConstant(constant);
      plot.heat_map->log_z = is_log;
      EXPECT_EQ(Draw({plot}, "constant"), std::make_pair(1200, 800));
    }
  }
}

TEST_F(DrawnPlotTest, NothingToDrawIsStillAPicture) {
  for (const bool is_log : {false, true}) {
    Plot plot;
    plot.log_x = plot.log_y = is_log;
    std::vector<Plot> plots;
    // Nothing, no points, none that can be drawn, constants (zero and tiny
    // ones too), and the ends of what a double can hold.
    for (const Series& series : {Series(),
                                 Line({}, {}),
                                 Line({1, 2}, {kNan, kInfinity}),
                                 Line({1, 1}, {0, 0}),
                                 Line({1e-320, 1e-320}, {1e-304, 1e-304}),
                                 Line({1, 1}, {-1e300, 1e300}),
                                 Line({1, 2}, {1e-320, 1.7e308})}) {
      plot.series = {series};
      plots.push_back(plot);
    }
    EXPECT_EQ(Draw(plots).second, 3 * 540);
  }
}

TEST_F(DrawnPlotTest, TextIsOnlyText) {
  const std::string evil = folder_ / "evil";
  std::vector<Plot> plots;
  for (const std::string& text :
       {"`touch " + evil + "`",
        "'; system('touch " + evil + "') #",
        "\"; system(\"touch " + evil + "\") #",
        "a\nsystem('touch " + evil + "')\n",
        std::string("@x %s \\ {/=50 _^} ' \xff \\")}) {
    Plot plot;
    plot.title = plot.x_label = plot.y_label = text;
    plot.series = {Line({1, 2}, {1, 2})};
    plot.series[0].title = text;
    plots.push_back(plot);
  }
  EXPECT_EQ(Draw(plots, "it's a -\"name\" `x`").second, 2 * 540);
  EXPECT_FALSE(std::filesystem::exists(evil));
}

TEST_F(DrawnPlotTest, TheScriptDrawsThePictureAgain) {
  Plot plot;
  plot.series = {Line({1, 2}, {1, 2})};
  Draw({plot});
  const std::string first = Read(folder_ / "plot.png");
  std::filesystem::remove(folder_ / "plot.png");
  const std::string command =
      "cd '" + (folder_ / "") + "' && gnuplot plot.gp > /dev/null 2>&1";
  EXPECT_EQ(std::system(command.c_str()), 0);
  EXPECT_EQ(Read(folder_ / "plot.png"), first);
}

TEST_F(DrawnPlotTest, PathsMayBeRelative) {
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder_ / "");
  Plot plot;
  std::string error;
  EXPECT_TRUE(WritePlots("-here.png", {plot}, &error)) << error;
  std::filesystem::current_path(before);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "-here.png"));
}

TEST_F(PlotTest, MissingGnuplotNamesThePackage) {
  const Path path(folder_ / "empty");
  Plot plot;
  std::string error;
  EXPECT_FALSE(WritePlots(folder_ / "plot.png", {plot}, &error));
  EXPECT_EQ(error,
            "no picture " + (folder_ / "plot.png") +
                ": gnuplot is not installed (apt install gnuplot-nox); its "
                "script is " +
                (folder_ / "plot.gp"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "plot.gp"));
}

TEST_F(PlotTest, FailuresOfGnuplotAreReported) {
  std::string error;
  const std::string png = folder_ / "plot.png";
  ASSERT_TRUE(WriteFile(png, "an old picture", &error)) << error;
  const std::string start = "no picture " + png + ": ";
  const std::string end = "; its script is " + (folder_ / "plot.gp");
  {
    const Path path(FakeGnuplot("echo line 3: bad command >&2; exit 1"));
    EXPECT_FALSE(WritePlots(png, {Plot()}, &error));
    EXPECT_EQ(error, start + "gnuplot failed: line 3: bad command\n" + end);
    EXPECT_FALSE(std::filesystem::exists(png));  // would pass for the new one
  }
  {
    const Path path(FakeGnuplot("kill -9 $$"));
    EXPECT_FALSE(WritePlots(png, {Plot()}, &error));
    EXPECT_EQ(error, start + "gnuplot was ended by signal 9" + end);
  }
  {
    const Path path(FakeGnuplot("exit 0"));
    EXPECT_FALSE(WritePlots(png, {Plot()}, &error));
    EXPECT_EQ(error,
              start + "gnuplot wrote nothing (is the folder writable?)" + end);
  }
  EXPECT_FALSE(WritePlots(folder_ / "none/plot.png", {Plot()}, &error));
  EXPECT_EQ(error,
            "cannot write " + (folder_ / "none/plot.gp") +
                ": No such file or directory");
}

TEST_F(PlotTest, AHangingGnuplotIsEnded) {
  // What it starts is ended with it: its pipe is at its end.
  const Path path(FakeGnuplot("/bin/sleep 1000"));
  const std::string png = folder_ / "plot.png";
  std::string error;
  EXPECT_FALSE(WritePlots(png, {Plot()}, &error, /*max_seconds=*/0.2));
  EXPECT_EQ(error,
            "no picture " + png +
                ": gnuplot took more than 0.2 s and was ended; its script is " +
                (folder_ / "plot.gp"));
}

TEST_F(PlotTest, ASignalEndsGnuplot) {
  // gnuplot itself goes on after Ctrl-C; this one sends it to the test.
  const Path path(FakeGnuplot("trap '' INT; kill -INT $PPID; /bin/sleep 1000"));
  std::string error;
  const Interrupt interrupt;
  EXPECT_FALSE(WritePlots(folder_ / "plot.png", {Plot()}, &error));
  EXPECT_NE(error.find("gnuplot was ended by a signal to this program"),
            std::string::npos)
      << error;
}

TEST_F(PlotTest, WrongSizesAndNamesAreBugs) {
  std::string error;
  Plot plot;
  EXPECT_DEATH(WritePlots(folder_ / "plot.pdf", {plot}, &error), "plot.pdf");
  EXPECT_DEATH(WritePlots(folder_ / "plot.png", {}, &error), "empty");
  plot.series = {Line({1, 2}, {1})};
  EXPECT_DEATH(WritePlots(folder_ / "plot.png", {plot}, &error), "line");
  plot.series = {Line({1}, {1})};
  plot.series[0].y_low = {1};
  EXPECT_DEATH(WritePlots(folder_ / "plot.png", {plot}, &error), "line");
  plot.series.clear();
  plot.contours = ContourField();
  plot.contours->x = {1};
  EXPECT_DEATH(WritePlots(folder_ / "plot.png", {plot}, &error), "cols");
  plot.contours.reset();
  plot.heat_map.emplace();
  plot.log_x = true;
  EXPECT_DEATH(WritePlots(folder_ / "plot.png", {plot}, &error), "log_x");
}

}  // namespace plot_test
}  // namespace invgrad
