#include "report/plot.h"

#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace plot_test {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Series Line(std::vector<double> x, std::vector<double> y) {
  Series series;
  series.title = "line";
  series.x = std::move(x);
  series.y = std::move(y);
  return series;
}

class PlotTest : public testing::Test {
 protected:
  // What the environment says where programs are, changed until the destructor.
  class Path {
   public:
    explicit Path(const std::string& path) : before_(std::getenv("PATH")) {
      setenv("PATH", path.c_str(), 1);
    }
    Path(const Path&) = delete;
    Path& operator=(const Path&) = delete;
    ~Path() { setenv("PATH", before_.c_str(), 1); }

   private:
    std::string before_;
  };

  // A program called gnuplot that does what `commands` say.
  std::string FakeGnuplot(const std::string& commands) {
    std::string folder = folder_ / "bin";
    std::filesystem::create_directory(folder);
    std::string error;
    EXPECT_TRUE(
        WriteFile(folder + "/gnuplot", "#!/bin/sh\n" + commands + "\n", &error))
        << error;
    chmod((folder + "/gnuplot").c_str(), 0755);
    return folder;
  }

  std::string Read(const std::string& path) {
    std::string bytes;
    std::string error;
    EXPECT_TRUE(ReadFile(path, &bytes, &error)) << error;
    return bytes;
  }

  // Draws, and returns the picture's width and height.
  std::pair<int, int> Draw(const std::vector<Plot>& plots,
                           const std::string& name = "plot") {
    std::string error;
    EXPECT_TRUE(WritePlots(folder_ / (name + ".png"), plots, &error)) << error;
    const std::string png = Read(folder_ / (name + ".png"));
    if (png.size() < 24 || png.substr(1, 3) != "PNG") {
      ADD_FAILURE() << "not a PNG";
      return {};
    }
    // The header chunk begins with two big-endian numbers of 32 bits.
    const auto number = [&png](size_t i) {
      return static_cast<unsigned char>(png[i + 2]) * 256 +
             static_cast<unsigned char>(png[i + 3]);
    };
    return {number(16), number(20)};
  }

  // The script that would draw, without drawing.
  std::string Script(const std::vector<Plot>& plots) {
    const Path path(FakeGnuplot("exit 1"));
    std::string error;
    WritePlots(folder_ / "script.png", plots, &error);
    return Read(folder_ / "script.gp");
  }
  std::string Script(const Plot& plot) { return Script(std::vector{plot}); }

  // The lines of a data block.
  static std::vector<std::string> Data(const std::string& script,
                                       const std::string& name) {
    std::istringstream text(script);
    std::string line;
    while (std::getline(text, line) && line != name + " << EOD") {
    }
    std::vector<std::string> lines;
    while (std::getline(text, line) && line != "EOD") {
      lines.push_back(line);
    }
    return lines;
  }

  static bool Has(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  }

  const TemporaryFolder folder_;
};

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
  plot.has_legend = false;
  plot.series = {Line({1, 2, 3}, {1, 2, 3})};
  const auto size = [&](int num_panels) {
    return Draw(std::vector<Plot>(num_panels, plot));
  };
  constexpr int kWidth = 115 + 480 + 35;
  EXPECT_EQ(size(3), std::make_pair(3 * (115 + 640 + 35), 700));
  EXPECT_EQ(size(4), std::make_pair(2 * kWidth, 2 * 540));
  EXPECT_EQ(size(5), std::make_pair(3 * kWidth, 2 * 540));
  EXPECT_EQ(size(24), std::make_pair(4 * kWidth, 6 * 540));
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
  EXPECT_TRUE(WritePlot("-here.png", plot, &error)) << error;
  std::filesystem::current_path(before);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "-here.png"));
}

TEST_F(PlotTest, MissingGnuplotNamesThePackage) {
  const Path path(folder_ / "empty");
  Plot plot;
  std::string error;
  EXPECT_FALSE(WritePlot(folder_ / "plot.png", plot, &error));
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
    EXPECT_FALSE(WritePlot(png, Plot(), &error));
    EXPECT_EQ(error, start + "gnuplot failed: line 3: bad command\n" + end);
    EXPECT_FALSE(std::filesystem::exists(png));  // would pass for the new one
  }
  {
    const Path path(FakeGnuplot("kill -9 $$"));
    EXPECT_FALSE(WritePlot(png, Plot(), &error));
    EXPECT_EQ(error, start + "gnuplot was ended by signal 9" + end);
  }
  {
    const Path path(FakeGnuplot("exit 0"));
    EXPECT_FALSE(WritePlot(png, Plot(), &error));
    EXPECT_EQ(error,
              start + "gnuplot wrote nothing (is the folder writable?)" + end);
  }
  EXPECT_FALSE(WritePlot(folder_ / "none/plot.png", Plot(), &error));
  EXPECT_EQ(error,
            "cannot write " + (folder_ / "none/plot.gp") +
                ": No such file or directory");
}

TEST_F(PlotTest, WhatCannotBeDrawnIsAGap) {
  Plot plot;
  plot.series = {
      Line({0, 1, 2, 3, 4, 5, 6}, {kNan, 1, kNan, kInfinity, -4, 5, kNan})};
  EXPECT_EQ(Data(Script(plot), "$panel0_series0"),
            (std::vector<std::string>{"1 1", "", "4 -4", "5 5", ""}));
  plot.log_y = true;
  EXPECT_EQ(Data(Script(plot), "$panel0_series0"),
            (std::vector<std::string>{"1 1", "", "5 5", ""}));
  plot.log_y = false;
  plot.log_x = true;
  plot.series[0].y[0] = 7.0;  // at x = 0
  EXPECT_EQ(Data(Script(plot), "$panel0_series0").front(), "1 1");
}

TEST_F(PlotTest, RangesAreKeptOrFitted) {
  Plot plot;
  plot.log_y = true;
  plot.series = {Line({0, 10}, {1e-8, 1.0})};
  std::string script = Script(plot);
  EXPECT_TRUE(Has(script, "set xrange [0:10]"));  // from edge to edge
  // 8 decades and 4 % of them on either side: 10^-8.32 to 10^0.32.
  EXPECT_TRUE(Has(script, "set yrange [4.786300923e-09:2.089296131]"));
  EXPECT_TRUE(Has(script, "set format y '10^{%T}'"));
  plot.x_range.high = 20.0;
  plot.y_range.low = 1e-3;
  plot.y_range.high = 10.0;
  script = Script(plot);
  EXPECT_TRUE(Has(script, "set xrange [0:20]"));
  EXPECT_TRUE(Has(script, "set yrange [0.001:10]"));
}

TEST_F(PlotTest, OneUnitIsAsLongOnBothAxes) {
  Plot plot;
  EXPECT_TRUE(Has(Script(plot), "set size noratio"));
  plot.equal_aspect = true;
  EXPECT_TRUE(Has(Script(plot), "set size ratio -1"));
}

TEST_F(PlotTest, ShortLogarithmicAxesHaveEnoughTicks) {
  Plot plot;
  plot.log_y = true;
  plot.series = {Line({0, 1}, {1, 1})};
  plot.y_range = {0.8, 60.0};
  EXPECT_TRUE(Has(Script(plot),
                  "set ytics (\"1\" 1, \"2\" 2, \"5\" 5, \"10\" 10, \"20\" 20, "
                  "\"50\" 50)\n"));
  // Less than a factor of five is drawn linear.
  EXPECT_TRUE(Has(Script(plot), "\nset logscale y\n"));
  plot.y_range = {2.0, 9.9};
  EXPECT_TRUE(Has(Script(plot), "unset logscale y\n"));
}

TEST_F(PlotTest, PanelsWithTheSameEntriesShareALegend) {
  Plot plot;
  plot.series = {Line({0, 1}, {0, 1})};
  const auto num_legends = [this](const std::vector<Plot>& plots) {
    const std::string script = Script(plots);
    const size_t first = script.find("set key at graph");
    return first == std::string::npos                               ? 0
           : script.find("set key", first + 1) == std::string::npos ? 1
                                                                    : 2;
  };
  EXPECT_EQ(num_legends({plot}), 1);
  EXPECT_EQ(num_legends({plot, plot, plot}), 1);
  Plot other = plot;
  other.series[0].title = "other";
  EXPECT_EQ(num_legends({plot, other}), 2);
  plot.has_legend = false;
  EXPECT_EQ(num_legends({plot}), 0);
  other.series[0].title.clear();
  EXPECT_EQ(num_legends({other}), 0);
}

TEST_F(PlotTest, ALineOfOnePointIsDrawnAsAPoint) {
  Plot plot;
  plot.series = {Line({1, 2}, {1, 2})};
  EXPECT_TRUE(Has(Script(plot), "$panel0_series0 using 1:2 with lines lw"));
  plot.series = {Line({1, 2}, {kNan, 2})};
  EXPECT_TRUE(Has(Script(plot), "$panel0_series0 using 1:2 with linespoints"));
  plot.series = {Line({1, 2}, {kNan, kNan})};
  EXPECT_TRUE(Has(Script(plot), "NaN with lines lw"));
}

TEST_F(PlotTest, EightCurvesAtMostKeepColourAndName) {
  std::vector<Plot> panels(2);
  for (int i = 0; i < 8; ++i) {
    for (Plot& panel : panels) {
      panel.series.push_back(Line({0, 1, 2}, {1, 8.0 - i, kNan}));
      panel.series.back().title = std::to_string(i);
    }
  }
  std::vector<Plot> eight = panels;
  MuteAllButTheLowest(&eight);
  EXPECT_EQ(eight[0].series.size(), 8u);
  EXPECT_FALSE(eight[0].series[0].is_muted);
  for (Plot& panel : panels) {
    panel.series.insert(panel.series.begin() + 2, {Line({}, {}), Series()});
    panel.series[2].title = "no value";
    panel.series[3].title = "low";
  }
  panels[0].series[3].x =
      panels[0].series[3].y = {0.5};  // the first one counts
  MuteAllButTheLowest(&panels);
  for (const Plot& panel : panels) {
    ASSERT_EQ(panel.series.size(), 11u);
    EXPECT_EQ(panel.series.back().title, "2 others");
    for (int i = 0; i < 10; ++i) {
      const bool is_muted = i == 0 || i == 2;  // 8 and no value
      EXPECT_EQ(panel.series[i].is_muted, is_muted) << i;
      EXPECT_EQ(panel.series[i].title.empty(), is_muted) << i;
    }
    EXPECT_EQ(panel.series[1].color, 0);
    EXPECT_EQ(panel.series[3].color, 1);
    EXPECT_EQ(panel.series[9].color, 7);
  }
  EXPECT_TRUE(Has(Script(panels), "lc rgb '#c4c4c4' title \"2 others\""));
}

TEST_F(PlotTest, ThirtySeriesLookDifferent) {
  Plot plot;
  plot.series.assign(30, Line({0, 1}, {0, 1}));
  std::istringstream script(Script(plot));
  std::vector<std::string> looks;
  for (std::string line; std::getline(script, line);) {
    const size_t begin = line.find(" with lines");
    if (begin != std::string::npos) {
      looks.push_back(line.substr(begin, line.find(" title") - begin));
    }
  }
  EXPECT_EQ(looks.size(), 30u);
  std::sort(looks.begin(), looks.end());
  EXPECT_EQ(std::unique(looks.begin(), looks.end()), looks.end());
}

TEST_F(PlotTest, LevelsAreQuantiles) {
  Plot plot;
  ContourField field;
  // z = 1 .. 16 in any monotone scale: the lines lie between the same points.
  field.x = {0, 1, 2, 3};
  field.y = {0, 1, 2, 3};
  field.z = Eigen::VectorXd::LinSpaced(16, 1, 16).reshaped(4, 4);
  plot.contours = field;
  EXPECT_TRUE(Has(Script(plot),
                  "levels discrete 1.5,2.5,3.5,4.5,5.5,6.5,7.5,8.5,9.5,10.5,"
                  "11.5,12.5,13.5,14.5\n"));
}

TEST_F(PlotTest, CellsAreNumberedOrLabelled) {
  Plot plot;
  plot.heat_map.emplace().z = Eigen::RowVector3d(5, kNan, 7);
  std::string script = Script(plot);
  EXPECT_EQ(Data(script, "$panel0_cells"),  // no cell at 1
            (std::vector<std::string>{"0 0 5", "2 0 7"}));
  EXPECT_TRUE(Has(script, "set xrange [-0.5:2.5]"));
  EXPECT_TRUE(Has(script, "set yrange [-0.5:0.5]"));
  EXPECT_TRUE(Has(script, "set cbrange [5:7]"));
  EXPECT_TRUE(Has(script, "set xtics auto"));
  plot.heat_map->x_labels = {"1", "100", "1e4"};
  plot.heat_map->y_labels = {"10"};
  script = Script(plot);
  EXPECT_TRUE(Has(script, R"(set xtics ("1" 0, "100" 1, "1e4" 2))"));
  EXPECT_TRUE(Has(script, R"(set ytics ("10" 0))"));
}

TEST_F(PlotTest, TicksThatAreGivenReplaceRoundNumbers) {
  Plot plot;
  plot.log_x = true;
  plot.series = {Line({8, 512}, {2, 3})};
  plot.x_ticks = {{8, "8"}, {64, "he \"x\""}, {512, "512"}};
  const std::string script = Script(plot);
  EXPECT_TRUE(
      Has(script, R"(set xtics ("8" 8, "he \042x\042" 64, "512" 512))"));
  EXPECT_TRUE(Has(script, "set ytics auto"));
}

TEST_F(PlotTest, ColorScalesAreKeptOrFitted) {
  Plot plot;
  plot.heat_map.emplace();
  plot.heat_map->z = Eigen::Matrix2d{{1e-4, 0.0}, {1.0, kInfinity}};
  plot.heat_map->z_label = "loss";
  std::string script = Script(plot);
  EXPECT_TRUE(Has(script, "unset logscale cb"));
  EXPECT_TRUE(Has(script, "set cbrange [0:1]"));
  EXPECT_TRUE(Has(script, "set cblabel \"loss\""));
  EXPECT_EQ(Data(script, "$panel0_cells").size(), 3u);
  plot.heat_map->log_z = true;
  script = Script(plot);
  EXPECT_TRUE(Has(script, "set logscale cb"));
  EXPECT_TRUE(Has(script, "set cbrange [0.0001:1]"));
  EXPECT_TRUE(Has(script, "set format cb '10^{%T}'"));
  EXPECT_EQ(Data(script, "$panel0_cells").size(), 2u);  // not that of 0
  plot.heat_map->z_range = {1e-6, 10.0};
  EXPECT_TRUE(Has(Script(plot), "set cbrange [1e-06:10]"));
  // Nothing of this is in other scripts.
  plot.heat_map.reset();
  EXPECT_FALSE(Has(Script(plot), "palette"));
}

TEST_F(PlotTest, WrongSizesAndNamesAreBugs) {
  std::string error;
  Plot plot;
  EXPECT_DEATH(WritePlot(folder_ / "plot.pdf", plot, &error), "plot.pdf");
  EXPECT_DEATH(WritePlots(folder_ / "plot.png", {}, &error), "empty");
  plot.series = {Line({1, 2}, {1})};
  EXPECT_DEATH(WritePlot(folder_ / "plot.png", plot, &error), "line");
  plot.series = {Line({1}, {1})};
  plot.series[0].y_low = {1};
  EXPECT_DEATH(WritePlot(folder_ / "plot.png", plot, &error), "line");
  plot.series.clear();
  plot.contours = ContourField();
  plot.contours->x = {1};
  EXPECT_DEATH(WritePlot(folder_ / "plot.png", plot, &error), "cols");
  plot.contours.reset();
  plot.heat_map.emplace();
  plot.log_x = true;
  EXPECT_DEATH(WritePlot(folder_ / "plot.png", plot, &error), "log_x");
}

}  // namespace plot_test
}  // namespace invgrad
