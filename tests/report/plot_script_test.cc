// What the scripts for gnuplot say, without drawing.

#include <algorithm>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "report/plot.h"
#include "tests/report/plot_test_fixture.h"

namespace invgrad {
namespace plot_script_test {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

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
  plot.title = "an empty one has no axes";
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

}  // namespace plot_script_test
}  // namespace invgrad
