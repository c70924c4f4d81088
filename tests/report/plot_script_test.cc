// What the scripts and the data for gnuplot say, without drawing.

#include <limits>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "report/plot.h"
#include "tests/report/plot_test_fixture.h"

namespace invgrad {
namespace plot_script_test {

using Strings = std::vector<std::string>;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr char kHeader[] = "panel,line,title,x,y,low,high,z\n";

TEST_F(PlotTest, WhatCannotBeDrawnIsAGap) {
  Plot plot;
  plot.series = {Line({1, 2, 3}, {1, kInfinity, -9})};
  EXPECT_EQ(Data({plot}),
            kHeader + std::string("1,1,\"line\",1,1,,,\n"
                                  "1,1,\"line\",2,NaN,,,\n"
                                  "1,1,\"line\",3,-9,,,\n\n"));
  plot.log_y = true;
  plot.series[0].y = {1, kNan, -9};
  plot.series.push_back(Line({0}, {100}));
  EXPECT_EQ(Data({plot}),
            kHeader + std::string("1,1,\"line\",1,1,,,\n"
                                  "1,1,\"line\",2,NaN,,,\n"
                                  "1,1,\"line\",3,NaN,,,\n\n"
                                  "1,2,\"line\",0,100,,,\n\n"));
}

TEST_F(PlotTest, LinesAreNumberedThroughAllPanels) {
  Plot plot;
  plot.series = {Line({1}, {2}), Line({3}, {4})};
  plot.series[1].y_low = {3};
  plot.series[1].y_high = {5};
  plot.series[1].color = 7;
  plot.series[1].style = Series::Style::kPoints;
  EXPECT_EQ(Data({plot, Plot(), plot}),
            kHeader + std::string("1,1,\"line\",1,2,,,\n\n"
                                  "1,2,\"line\",3,4,3,5,\n\n"
                                  "3,3,\"line\",1,2,,,\n\n"
                                  "3,4,\"line\",3,4,3,5,\n\n"));
  const std::string script = Script({plot, Plot(), plot});
  EXPECT_TRUE(Has(script, "array color[4] = [0,7,0,7]"));
  // A line of one point is drawn as a point, too.
  EXPECT_TRUE(Has(script, "array style[4] = [3,2,3,2]"));
  EXPECT_TRUE(Has(script,
                  "p = 3; first = 3; last = 4; bands = \"4 \"; "
                  "points = \"3 4 \"\n"
                  "@start@of_bands@of_lines@of_points"));
  EXPECT_TRUE(Has(script, "set multiplot next"));
}

TEST_F(PlotTest, TheLegendIsThatOfThePanelWithMostTitles) {
  Plot one, two;
  one.series = {Line({1}, {2})};
  two.series = {Line({1}, {2}), Line({1}, {2}), Line({1}, {2})};
  two.series[1].title.clear();
  two.series[2].title = "longer";
  two.series[2].style = Series::Style::kPoints;
  const std::string script = Script({one, two, one});
  EXPECT_TRUE(Has(script, "legend = 6\n"));
  EXPECT_TRUE(Has(script, "key_lines = \"2 \"\n"));
  EXPECT_TRUE(Has(script, "key_points = \"4 \"\n"));
  EXPECT_TRUE(Has(script, "@start@of_lines@of_points@key\n"));
  one.series[0].title.clear();
  EXPECT_TRUE(Has(Script(one), "legend = 0\n"));
  EXPECT_FALSE(Has(Script(one), "@key"));
}

TEST_F(PlotTest, RangesAreKeptOrLeftToGnuplot) {
  Plot plot;
  plot.log_y = true;
  plot.series = {Line({0, 10}, {1e-8, 1.0})};
  EXPECT_TRUE(Has(Script(plot), "set xrange [*:*] noextend\n"));
  EXPECT_TRUE(Has(Script(plot), "set yrange [*:*]\nset format y '10^{%T}'"));
  plot.x_range.high = 20.0;
  plot.y_range = {1e-3, 10.0};
  EXPECT_TRUE(Has(Script(plot), "set xrange [*:20]"));
  EXPECT_TRUE(Has(Script(plot), "set yrange [0.001:10]"));
}

TEST_F(PlotTest, ShortLogarithmicAxesHaveEnoughTicks) {
  Plot plot;
  plot.log_y = true;
  plot.series = {Line({0, 1}, {1, 1})};
  plot.y_range = {0.8, 60.0};
  EXPECT_TRUE(Has(Script(plot), "\nset logscale y\n"));
  EXPECT_TRUE(Has(Script(plot), "set format y '%h'\nset ytics 0.5, 2\n"));
  // Less than a factor of five is drawn linear.
  plot.y_range = {2.0, 9.9};
  EXPECT_TRUE(Has(Script(plot), "unset logscale y\n"));
}

TEST_F(PlotTest, TicksThatAreGivenReplaceRoundNumbers) {
  Plot plot;
  plot.log_x = true;
  plot.series = {Line({8, 512}, {2, 3})};
  plot.x_ticks = {{8, "8"}, {64, "he \"x\""}, {512, "512"}};
  EXPECT_TRUE(
      Has(Script(plot), R"(set xtics ("8" 8, "he \042x\042" 64, "512" 512))"));
  EXPECT_TRUE(Has(Script(plot), "set ytics auto"));
}

TEST_F(PlotTest, OneUnitIsAsLongOnBothAxes) {
  Plot plot;
  plot.title = "an empty one has no axes";
  EXPECT_TRUE(Has(Script(plot), "set size noratio"));
  plot.equal_aspect = true;
  EXPECT_TRUE(Has(Script(plot), "set size ratio -1"));
}

TEST_F(PlotTest, CellsHavePlacesAndColors) {
  Plot plot;
  HeatMap& map = plot.heat_map.emplace();
  map.z = Eigen::Matrix2d{{1e-4, 0.0}, {1.0, kInfinity}};
  map.x_first = 10.0;
  map.x_step = 0.5;
  map.z_label = "loss";
  EXPECT_EQ(Data({plot}),  // no cell at infinity
            kHeader + std::string("1,0,,10,0,,,0.0001\n"
                                  "1,0,,10.5,0,,,0\n"
                                  "1,0,,10,1,,,1\n"));
  std::string script = Script(plot);
  EXPECT_TRUE(Has(script, "maps = 1\n"));
  EXPECT_TRUE(Has(script, "w = 0.25; h = 0.5\n"));
  EXPECT_TRUE(Has(script, "set cblabel \"loss\""));
  EXPECT_TRUE(Has(script, "unset logscale cb\nset cbrange [0:1]"));
  map.log_z = true;
  map.z_range = {1e-6, 10.0};
  script = Script(plot);
  EXPECT_TRUE(Has(script, "set logscale cb\nset cbrange [1e-06:10]"));
  EXPECT_FALSE(Has(Data({plot}), ",,,0\n"));  // not that of 0
  plot.heat_map.reset();
  EXPECT_TRUE(Has(Script(plot), "maps = 0\n"));
}

// gnuplot draws nothing for a given range that is empty.
TEST_F(PlotTest, AnEmptyRangeIsNotGiven) {
  Plot plot;
  plot.series.emplace_back();
  plot.series[0].x = {0.0, 1.0};
  plot.series[0].y = {2.0, 2.0};
  plot.y_range = {2.0, 2.0};
  EXPECT_TRUE(Has(Script(plot), "set yrange [*:*]"));
  plot.y_range = {2.0, 3.0};
  EXPECT_TRUE(Has(Script(plot), "set yrange [2:3]"));
}

TEST(ShortNames, LeaveOutWhatTheLabelsOfAMethodShare) {
  EXPECT_EQ(ShortNames({"adam:step_size=1e-3", "adaptive", "a/b/adam:x=1"}),
            (Strings{"adam", "adaptive", "a/b/adam"}));
  EXPECT_EQ(ShortNames({"adam:step_size=1e-3:batch_size=8",
                        "adam:step_size=1e-4:batch_size=8",
                        "adam:batch_size=8"}),
            (Strings{"adam:step_size=1e-3", "adam:step_size=1e-4", "adam"}));
  EXPECT_EQ(
      ShortNames(
          {"adam:epochs=5>newton:x=1", "adam:epochs=6>newton:x=1", "adam"}),
      (Strings{"adam:epochs=5>newton", "adam:epochs=6>newton", "adam"}));
  EXPECT_EQ(ShortNames({"ceres_lm+half_inverse:rho=1", "ceres_lm"}),
            (Strings{"ceres_lm+half_inverse", "ceres_lm"}));
  EXPECT_EQ(ShortNames({"", "x"}), (Strings{"", "x"}));
  // The same settings in other phases.
  EXPECT_EQ(ShortNames({"adam:x=1>newton:x=2:y=3", "adam:x=2>newton:x=1:y=3"}),
            (Strings{"adam:x=1>newton:x=2", "adam:x=2>newton:x=1"}));
  EXPECT_EQ(ShortNames({"adam:x=1:y=2", "adam:y=2:x=1"}),
            (Strings{"adam:x=1:y=2", "adam:y=2:x=1"}));
}

}  // namespace plot_script_test
}  // namespace invgrad
