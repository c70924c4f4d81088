#include "report/html_report.h"

#include <cmath>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "report/html_charts.h"
#include "tests/support/browser.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace {

constexpr char kNasty[] = "</script><b> \"a\" & 'b' \\ \x01";

// Two methods, of which the second is the better one, with two views.
HtmlReport SmallReport() {
  HtmlReport report;
  report.title = "compare: toy";
  report.methods = {{"adam", "adam:step_size=1e-3"}, {kNasty, kNasty}};
  HtmlReport::Chart& chart = report.charts.emplace_back();
  chart.title = "Curves";
  for (const char* x_label : {"seconds", "step"}) {
    Plot& view = chart.views.emplace_back();
    view.x_label = x_label;
    view.y_label = "test loss";
    view.log_x = view.log_y = true;
    for (int method = 0; method < 2; ++method) {
      Series& series = view.series.emplace_back();
      series.color = method;
      series.x = {1.0, 10.0, 100.0};
      series.y = {1.0, 0.1, method == 0 ? 0.05 : 1e-6};
      series.y_low = series.y_high = series.y;
    }
  }
  HtmlReport::Sheet& sheet = report.sheets.emplace_back();
  sheet.title = "Methods";
  sheet.least = {"test loss"};
  for (const auto& [method, loss] :
       std::vector<std::pair<const char*, const char*>>{
           {"adam:step_size=1e-3", "0.05"}, {kNasty, "1e-06"}, {"late", "-"}}) {
    sheet.table.BeginRow();
    sheet.table.Add("method", method, Table::Align::kLeft);
    sheet.table.Add("test loss", loss);
  }
  return report;
}

size_t Count(const std::string& text, const std::string& part) {
  size_t count = 0;
  for (size_t at = text.find(part); at != std::string::npos;
       at = text.find(part, at + 1)) {
    ++count;
  }
  return count;
}

TEST(HtmlReport, EscapesWhatHtmlWouldRead) {
  EXPECT_EQ(EscapeHtml("a<b> & \"c\" 'd'"),
            "a&lt;b&gt; &amp; &quot;c&quot; &#39;d&#39;");
  HtmlReport report = SmallReport();
  report.title = report.question = report.answer = report.progress =
      report.command = kNasty;
  report.warnings = {kNasty};
  report.facts = {{kNasty, kNasty}};
  const std::string html = ToHtml(report);
  EXPECT_EQ(Count(html, "</script>"), 2u);  // data and script
  EXPECT_EQ(Count(html, "<b>"), 0u);
}

TEST(HtmlReport, ReadsNothingButItself) {
  const std::string html = ToHtml(SmallReport());
  for (const char* word :
       {" src=\"http", "@import", "url(\"http", "<link", "fetch("}) {
    EXPECT_EQ(Count(html, word), 0u) << word;
  }
}

TEST(HtmlReport, OnlyARunThatGoesOnIsReadAgain) {
  HtmlReport report = SmallReport();
  EXPECT_EQ(Count(ToHtml(report), "http-equiv=refresh"), 0u);
  report.progress = "1 of 2 runs are done";
  EXPECT_EQ(Count(ToHtml(report), "http-equiv=refresh"), 1u);
}

TEST(HtmlReport, MarksTheBestCellOfAColumnAndNamesMethodsShortly) {
  const std::string html = ToHtml(SmallReport());
  EXPECT_EQ(Count(html, "class=best"), 1u);
  EXPECT_NE(html.find("<td class=best>1e-06</td>"), std::string::npos);
  EXPECT_NE(html.find("<abbr title=\"adam:step_size=1e-3\">adam</abbr>"),
            std::string::npos);
}

TEST(HtmlReport, ABestCellMayBeTheGreatestAndAShare) {
  HtmlReport report;
  HtmlReport::Sheet& sheet = report.sheets.emplace_back();
  sheet.greatest = {"solved"};
  for (const char* solved : {"9 of 54", "50 of 54", "50 of 54", "many"}) {
    sheet.table.BeginRow();
    sheet.table.Add("solved", solved);
  }
  EXPECT_EQ(Count(ToHtml(report), "<td class=best>50 of 54</td>"), 2u);
}

TEST(HtmlReport, AMapMarksTheLowestOfItsPanelsAtEachPlace) {
  HtmlReport::Maps maps;
  for (const double left : {1.0, 3.0}) {
    Plot& panel = maps.panels.emplace_back();
    panel.heat_map.emplace();
    panel.heat_map->z.resize(1, 2);
    panel.heat_map->z << left, 4.0 - left;
    panel.heat_map->z_range = {1.0, 3.0};
    panel.x_ticks = {{0.0, "a<b"}, {1.0, "c"}};
  }
  const std::string html = MapsHtml(maps);
  EXPECT_EQ(
      Count(html, "class=best style=\"background:#440154;color:#fff\">1<"), 2u);
  EXPECT_EQ(Count(html, "<td style=\"background:#fde725;color:#000\">3<"), 2u);
  EXPECT_EQ(Count(html, "<th>a&lt;b</th>"), 2u);
  maps.panels[0].heat_map->z(0, 0) = NAN;
  EXPECT_EQ(Count(MapsHtml(maps), "<td>-</td>"), 1u);
}

TEST(HtmlReport, SaysWhereAPictureIsThatIsTooLarge) {
  const TemporaryFolder folder;
  std::string error;
  const std::string small = folder / "small.png", large = folder / "large.png";
  ASSERT_TRUE(WriteFile(small, "Man", &error)) << error;
  ASSERT_TRUE(WriteFile(large, std::string(1'200'000, 'x'), &error)) << error;
  HtmlReport report;
  report.images = {{large, "fields"}, {small, "paths"}, {folder / "no", "no"}};
  const std::string html = ToHtml(report);
  EXPECT_NE(html.find("fields (too large for this page: large.png)"),
            std::string::npos);
  EXPECT_NE(html.find("base64,TWFu\""), std::string::npos);
  EXPECT_EQ(Count(html, "<figure>"), 1u);
}

TEST(HtmlReport, NineMethodsFromFiveSeedsTakeLessThanTwoMegabytes) {
  const TemporaryFolder folder;
  std::string error;
  const std::string png = folder / "neurons.png";
  ASSERT_TRUE(WriteFile(png, std::string(1'140'000, 'x'), &error)) << error;
  HtmlReport report = SmallReport();
  for (int view = 0; view < 9; ++view) {
    Plot& plot = report.charts[0].views.emplace_back(report.charts[0].views[0]);
    plot.series.clear();
    for (int method = 0; method < 9; ++method) {
      Series& series = plot.series.emplace_back();
      for (int i = 1; i <= 100'000; ++i) {
        series.x.push_back(i);
        series.y.push_back(1.2345678 / i);
      }
      series.y_low = series.y_high = series.y;
    }
  }
  report.images = {{png, "neurons"}};
  EXPECT_LT(ToHtml(report).size(), 2'000'000u);
}

TEST(HtmlReport, ThinnedCurvesKeepTheirEnds) {
  HtmlReport report = SmallReport();
  Series& series = report.charts[0].views[0].series[0];
  series.y_low = series.y_high = {};
  series.x = series.y = {};
  for (int i = 0; i <= 100'000; ++i) {
    series.x.push_back(i);
    series.y.push_back(i);
  }
  const std::string json = ChartsJson(report);
  EXPECT_NE(json.find("\"x\":[1.0,2.0,3.0,"),
            std::string::npos);  // 0 has no log
  EXPECT_NE(json.find(",100000.0]"), std::string::npos);
  EXPECT_LT(json.size(), 10'000u);
}

// --- In a browser ---

constexpr char kCurves[] = "document.querySelectorAll('path.curve').length";

TEST(HtmlReportInBrowser, DrawsACurveForEachMethodAndShowsNamesAsTheyAre) {
  INVGRAD_NEED_BROWSER();
  EXPECT_EQ(RunInBrowser(ToHtml(SmallReport()),
                         std::string("return ") + kCurves +
                             " + ' ' + document.querySelectorAll('.key span')"
                             "[1].textContent.trim()"),
            "2 &lt;/script&gt;&lt;b&gt; \"a\" &amp; 'b' \\ \x01");
}

TEST(HtmlReportInBrowser, AClickHidesAMethodAndAnotherShowsItAgain) {
  INVGRAD_NEED_BROWSER();
  EXPECT_EQ(RunInBrowser(ToHtml(SmallReport()),
                         std::string("const click = () => {"
                                     "document.querySelector('.key').click();"
                                     "return ") +
                             kCurves + "}; return [click(), click()]"),
            "1,2");
}

TEST(HtmlReportInBrowser, AClickSortsTheTableAndEmptyCellsStayLast) {
  INVGRAD_NEED_BROWSER();
  EXPECT_EQ(
      RunInBrowser(ToHtml(SmallReport()),
                   "const head = document.querySelectorAll('th button')[1];"
                   "const cells = () => [...document.querySelectorAll("
                   "'tbody td:last-child')].map((c) => c.textContent);"
                   "head.click(); const up = cells(); head.click();"
                   "return [...up, ...cells()]"),
      "1e-06,0.05,-,0.05,1e-06,-");
}

TEST(HtmlReportInBrowser, DraggingZoomsAndADoubleClickShowsAllAgain) {
  INVGRAD_NEED_BROWSER();
  EXPECT_EQ(
      RunInBrowser(
          ToHtml(SmallReport()),
          "const svg = () => document.querySelector('.box svg');"
          "const send = (name, x, y) => { const b = svg()."
          "getBoundingClientRect(); svg().dispatchEvent(new MouseEvent(name, "
          "{clientX: b.left + x, clientY: b.top + y})); };"
          "const last = () => charts[0].x.value(charts[0].x.pixel(100)) && "
          "charts[0].x.ticks.at(-1)[0];"
          "const all = last(); send('pointerdown', 100, 60);"
          "send('pointermove', 300, 200); send('pointerup', 300, 200);"
          "const zoomed = last(); send('dblclick', 100, 60);"
          "return [zoomed < all, last() === all]"),
      "true,true");
}

TEST(HtmlReportInBrowser, ThePointerNamesTheNearestCurve) {
  INVGRAD_NEED_BROWSER();
  EXPECT_EQ(
      RunInBrowser(ToHtml(SmallReport()),
                   "const c = charts[0];"
                   "c.hover(c.x.pixel(100), c.y.pixel(0.05), c.view().series);"
                   "return document.querySelector('.tip').textContent"),
      "adam\ntest loss 0.05 (0.05 to 0.05)\nseconds 100");
}

TEST(HtmlReportInBrowser, AChoiceShowsAnotherView) {
  INVGRAD_NEED_BROWSER();
  EXPECT_EQ(RunInBrowser(ToHtml(SmallReport()),
                         "const select = document.querySelector('.bar select');"
                         "select.value = 'step'; select.dispatchEvent(new "
                         "Event('change')); return charts[0].view().x"),
            "step");
}

TEST(HtmlReportInBrowser,
     AReportWithoutCurvesLoadsAndNothingIsWiderThanAPhone) {
  INVGRAD_NEED_BROWSER();
  HtmlReport empty;
  empty.title = "compare: toy";
  EXPECT_EQ(RunInBrowser(ToHtml(empty), "return 'loaded'"), "loaded");
  HtmlReport report = SmallReport();
  report.command = std::string(500, 'x');
  EXPECT_EQ(RunInBrowser(ToHtml(report),
                         "return document.documentElement.scrollWidth <= "
                         "document.documentElement.clientWidth",
                         500),
            "true");
}

}  // namespace
}  // namespace invgrad
