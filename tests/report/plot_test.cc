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

TEST_F(DrawnPlotTest, LinesPointsBandsAndMapsAreDrawn) {
  Plot plot;
  plot.title = "title";
  plot.log_y = true;
  plot.series = {Line({1, 2, 3}, {1e-3, 1e-6, 1e-9})};
  const std::pair<int, int> size = Draw({plot}, "line");
  EXPECT_GT(size.first, 900);
  plot.series[0].style = Series::Style::kPoints;
  EXPECT_EQ(Draw({plot}, "points"), size);
  plot.series[0].style = Series::Style::kLines;
  plot.series[0].y_low = {1e-4, 0.0, kNan};
  plot.series[0].y_high = {1e-2, 1e-5, kInfinity};
  EXPECT_EQ(Draw({plot}, "band"), size);
  plot.log_y = false;
  plot.heat_map.emplace().z = Eigen::MatrixXd::Random(4, 3);
  Draw({plot}, "map");
  plot.heat_map->z(0, 0) = kNan;
  Draw({plot}, "blank");
  // Each of them leaves other pixels.
  EXPECT_NE(Read(folder_ / "line.png"), Read(folder_ / "points.png"));
  EXPECT_NE(Read(folder_ / "line.png"), Read(folder_ / "band.png"));
  EXPECT_NE(Read(folder_ / "map.png"), Read(folder_ / "blank.png"));
}

TEST_F(DrawnPlotTest, PanelsStandSideBySideOrInRows) {
  Plot plot;
  plot.series = {Line({1, 2, 3}, {1, 2, 3})};
  const auto size = [&](int num_panels, int num_columns = 0) {
    return Draw(std::vector<Plot>(num_panels, plot), "panels", num_columns);
  };
  const std::pair<int, int> two = size(2), four = size(4);
  EXPECT_EQ(size(3).second, two.second);
  EXPECT_EQ(size(24), std::make_pair(four.first, 6 * size(8).second / 2));
  EXPECT_EQ(size(6, 2).second, 3 * size(4, 2).second / 2);
  for (const int num_panels : {1, 2, 3, 4, 9}) {
    EXPECT_LE(size(num_panels).first, 2000);
  }
  EXPECT_LE(size(9, 9).first, 2000);
  // An empty place is as large as a panel, and has no axes.
  EXPECT_EQ(Draw({plot, Plot(), plot, plot}, "gap"), four);
}

TEST_F(DrawnPlotTest, MapsOfOneColorOrNoneAreDrawn) {
  Plot plot;
  plot.heat_map.emplace().z.setConstant(2, 3, kNan);
  const std::pair<int, int> size = Draw({plot}, "empty");
  for (const double constant : {0.0, 1e-300, -3.0}) {
    for (const bool is_log : {false, true}) {
      plot.heat_map->z.setConstant(constant);
      plot.heat_map->log_z = is_log;
      EXPECT_EQ(Draw({plot}, "constant"), size);
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
    Draw(plots);
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
  Draw(plots, "it's a -\"name\" `x`");
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
            "cannot write " + (folder_ / "none/plot.csv") +
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
}

}  // namespace plot_test
}  // namespace invgrad
