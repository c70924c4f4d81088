// The documentation says what the code says: quotations are current, links lead
// somewhere, and the tutorial's program does what its page promises.

#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "docs/tutorials/01_shuttlecock.h"
#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "tests/support/source_tree.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace {

namespace fs = std::filesystem;

const fs::path kRoot = SourceDir();

std::string Read(const fs::path& path) {
  std::string text;
  std::string error;
  EXPECT_TRUE(ReadFile(path.string(), &text, &error)) << error;
  return text;
}

std::vector<std::string> SplitLines(const std::string& text) {
  std::vector<std::string> lines;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return lines;
}

// README.md and all pages under docs.
std::vector<fs::path> Pages() {
  std::vector<fs::path> pages;
  if (fs::exists(kRoot / "README.md")) pages.push_back(kRoot / "README.md");
  for (const auto& entry : fs::recursive_directory_iterator(kRoot / "docs")) {
    if (entry.path().extension() == ".md") pages.push_back(entry.path());
  }
  return pages;
}

// "// [marker]" or "// [/marker]"; not "// [1] A source."
bool IsMarker(const std::string& text) {
  return text.rfind("// [", 0) == 0 && text.back() == ']';
}

// What stands between the lines "// [marker]" and "// [/marker]", without the
// indentation of the first of them. Markers may overlap; lines that are markers
// are not part of it. Empty, with a failure, unless both occur exactly once.
std::string MarkedRegion(const std::string& source, const std::string& marker) {
  std::string region;
  size_t indentation = 0;
  int num_begins = 0;
  int num_ends = 0;
  for (const std::string& line : SplitLines(source)) {
    const size_t first = std::min(line.find_first_not_of(' '), line.size());
    const std::string text = line.substr(first);
    if (text == "// [" + marker + "]") {
      ++num_begins;
      indentation = first;
    } else if (text == "// [/" + marker + "]") {
      ++num_ends;
    } else if (num_begins == 1 && num_ends == 0 && !IsMarker(text)) {
      region += (first < indentation ? text : line.substr(indentation)) + "\n";
    }
  }
  EXPECT_EQ(num_begins, 1) << "// [" << marker << "]";
  EXPECT_EQ(num_ends, 1) << "// [/" << marker << "]";
  return num_begins == 1 && num_ends == 1 ? region : "";
}

// A page quotes a file beside it by
//
//   <!-- quoted from FILE: MARKER -->
//   ```cpp
//   ...
//   ```
struct Quotation {
  std::string file;
  std::string marker;
  std::string text;
};

std::vector<Quotation> Quotations(const std::string& page) {
  const std::string begin = "<!-- quoted from ";
  const std::string end = " -->";
  std::vector<Quotation> quotations;
  const std::vector<std::string> lines = SplitLines(page);
  for (size_t i = 0; i < lines.size(); ++i) {
    if (lines[i].rfind(begin, 0) != 0) continue;
    const size_t colon = lines[i].find(": ");
    Quotation quotation;
    if (colon == std::string::npos || i + 1 == lines.size() ||
        lines[i + 1] != "```cpp") {
      ADD_FAILURE() << "not followed by ```cpp, or without marker: "
                    << lines[i];
      continue;
    }
    quotation.file = lines[i].substr(begin.size(), colon - begin.size());
    quotation.marker =
        lines[i].substr(colon + 2, lines[i].size() - end.size() - colon - 2);
    for (i += 2; i < lines.size() && lines[i] != "```"; ++i) {
      quotation.text += lines[i] + "\n";
    }
    quotations.push_back(quotation);
  }
  return quotations;
}

// The page without what stands between lines of ```: C++'s [a](b) is no link.
std::string WithoutCode(const std::string& page) {
  std::string text;
  bool is_code = false;
  for (const std::string& line : SplitLines(page)) {
    if (line.rfind("```", 0) == 0) {
      is_code = !is_code;
    } else if (!is_code) {
      text += line + "\n";
    }
  }
  return text;
}

// The targets of [text](target) and ![text](target) that are files.
std::vector<std::string> RelativeLinks(const std::string& whole_page) {
  const std::string page = WithoutCode(whole_page);
  std::vector<std::string> links;
  for (size_t at = page.find("]("); at != std::string::npos;
       at = page.find("](", at + 2)) {
    const size_t end = page.find(')', at);
    std::string link = page.substr(at + 2, end - at - 2);
    if (link.find("://") != std::string::npos) continue;
    link = link.substr(0, link.find('#'));
    if (!link.empty()) links.push_back(link);
  }
  return links;
}

TEST(Docs, MarkedRegionIsUnindentedAndLeavesOutMarkers) {
  const std::string source =
      "a\n  // [x]\n  b\n\n    c\n  // [y]\n  // [1] e\n  // [/x]\n  d\n"
      "  // [/y]\n";
  EXPECT_EQ(MarkedRegion(source, "x"), "b\n\n  c\n// [1] e\n");
  EXPECT_EQ(MarkedRegion(source, "y"), "// [1] e\nd\n");
}

TEST(Docs, QuotationsAndLinksAreFound) {
  const std::string page =
      "[a](b.md#c) ![d](e.png) [f](http://g) [h](#i)\n"
      "<!-- quoted from j.cc: k -->\n```cpp\nl\n\n[m](o)\n```\nn\n";
  EXPECT_EQ(RelativeLinks(page), (std::vector<std::string>{"b.md", "e.png"}));
  const std::vector<Quotation> quotations = Quotations(page);
  ASSERT_EQ(quotations.size(), 1u);
  EXPECT_EQ(quotations[0].file, "j.cc");
  EXPECT_EQ(quotations[0].marker, "k");
  EXPECT_EQ(quotations[0].text, "l\n\n[m](o)\n");
}

TEST(Docs, QuotationsAreCurrent) {
  int num_quotations = 0;
  for (const fs::path& page : Pages()) {
    for (const Quotation& quotation : Quotations(Read(page))) {
      SCOPED_TRACE(page.string() + ": " + quotation.file + ": " +
                   quotation.marker);
      EXPECT_EQ(quotation.text,
                MarkedRegion(Read(page.parent_path() / quotation.file),
                             quotation.marker));
      ++num_quotations;
    }
  }
  EXPECT_GT(num_quotations, 0);
}

TEST(Docs, LinksLeadToFiles) {
  int num_links = 0;
  for (const fs::path& page : Pages()) {
    for (const std::string& link : RelativeLinks(Read(page))) {
      EXPECT_TRUE(fs::exists(page.parent_path() / link))
          << page << " links to " << link;
      ++num_links;
    }
  }
  EXPECT_GT(num_links, 0);
}

// Runs a tutorial's program with `arguments`; returns its exit code and what it
// printed.
std::pair<int, std::string> RunTutorial(
    const std::string& arguments,
    const std::string& output,
    const std::string& program = "01_new_problem") {
  const int status = std::system(("'" + BinDir() + "/" + program + "' " +
                                  arguments + " > '" + output + "' 2>&1")
                                     .c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, Read(output)};
}

TEST(NewProblemTutorial, PrintsItsTableAndDrawsItsPicture) {
  const TemporaryFolder folder;
  const std::string picture = folder / "picture.png";
  // A budget of a few steps.
  const auto [exit_code, text] =
      RunTutorial("--seconds=0.01 --picture='" + picture + "'", folder / "out");
  EXPECT_EQ(exit_code, 0) << text;
  for (const char* word : {"finite differences",
                           "test loss",
                           "gradient_descent",
                           "adam",
                           "half_inverse",
                           "gauss_newton",
                           "levenberg_marquardt",
                           "ceres_lm"}) {
    EXPECT_NE(text.find(word), std::string::npos) << word << " in: " << text;
  }
  EXPECT_EQ(Read(picture).substr(1, 3), "PNG");
}

TEST(PhysicalGradientsTutorial, PrintsItsTableAndCountsInverses) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("--seconds=0.02", folder / "out", "02_physical_gradients");
  EXPECT_EQ(exit_code, 0) << text;
  for (const char* word :
       {"miss [mm]", "dp_adam", "numerical inverse", "sip"}) {
    EXPECT_NE(text.find(word), std::string::npos) << word << " in: " << text;
  }
}

TEST(CeresSolveTutorial, ReportsOneSolveAndCountsTruths) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("--starts=3", folder / "out", "04_ceres_solve");
  EXPECT_EQ(exit_code, 0) << text;
  // The first start leads both solvers to a length of 1.503 m (truth: 1.5).
  for (const char* word : {"length 1.50",
                           " proposed, ",
                           "nobody",
                           "initial_trust_region_radius = 1",
                           "control=gain",
                           " of 3"}) {
    EXPECT_NE(text.find(word), std::string::npos) << word << " in: " << text;
  }
}

TEST(CeresSolveTutorial, RefusesUnknownRules) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("--rules=half_invers", folder / "out", "04_ceres_solve");
  EXPECT_EQ(exit_code, 1);
  EXPECT_NE(text.find("half_inverse"), std::string::npos) << text;
}

// "20 lines with everything": the page's promise.
TEST(CeresSolveTutorial, AddsTwentyLines) {
  const std::string source = Read(kRoot / "docs/tutorials/04_ceres_solve.cc");
  size_t num_lines = 0;
  for (const char* marker : {"includes", "rule", "added", "report"}) {
    num_lines += SplitLines(MarkedRegion(source, marker)).size();
  }
  EXPECT_LE(num_lines, 20u);
}

TEST(RobotTutorial, CalibratesTrainsAndDrawsItsPicture) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("--seconds=0.01 --folder='" + (folder / "") + "'",
                  folder / "out",
                  "05_robot_simulator");
  EXPECT_EQ(exit_code, 0) << text;
  for (const char* word : {"calibrated: wheels 0.10",
                           "finite differences",
                           "real miss [mm]",
                           "adam",
                           "half_inverse",
                           "ceres_lm"}) {
    EXPECT_NE(text.find(word), std::string::npos) << word << " in: " << text;
  }
  const std::string script =
      (kRoot / "docs/tutorials/05_robot_simulator.gp").string();
  EXPECT_EQ(std::system(("cd '" + (folder / "") + "' && gnuplot '" + script +
                         "' > gnuplot.txt 2>&1")
                            .c_str()),
            0)
      << Read(folder / "gnuplot.txt");
  EXPECT_EQ(Read(folder / "05_robot_simulator.png").substr(1, 3), "PNG");
}

// Line for line, but for motions: which of several that are as good is told
// may depend on rounding.
TEST(RankReportTutorial, PrintsWhatThePageShows) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("", folder / "out", "03_rank_report");
  EXPECT_EQ(exit_code, 0) << text;
  const std::vector<std::string> page =
      SplitLines(Read(kRoot / "docs/tutorials/03_rank_report.md"));
  int num_lines = 0;
  for (const std::string& line : SplitLines(text)) {
    const std::string start = line.substr(0, 3);
    if (start == "===" || start == "  +" || start == "  -") continue;
    EXPECT_GT(std::count(page.begin(), page.end(), line), 0) << line;
    ++num_lines;
  }
  EXPECT_GT(num_lines, 30);
}

TEST(NewProblemTutorial, RefusesUnknownRules) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("--rules=half_invers", folder / "out");
  EXPECT_EQ(exit_code, 1);
  EXPECT_NE(text.find("half_inverse"), std::string::npos) << text;
}

// The header on the page is the program's problem: same physics, and data of
// the promised size.
TEST(NewProblemTutorial, HeaderMakesTheSameProblem) {
  EXPECT_EQ(
      MarkedRegion(Read(kRoot / "docs/tutorials/01_shuttlecock.h"), "functor"),
      MarkedRegion(Read(kRoot / "docs/tutorials/01_new_problem.cc"),
                   "functor"));
  LearningProblem problem;
  std::string error;
  ASSERT_TRUE(Shuttlecock::Create({}, nullptr, &problem, &error)) << error;
  EXPECT_EQ(problem.train.num_samples(), 512);
  EXPECT_EQ(problem.test.num_samples(), 512);
  const Eigen::MatrixXd wrong = Eigen::MatrixXd::Ones(4, 3);
  EXPECT_FALSE(Shuttlecock::Create({}, &wrong, &problem, &error));
}

// Falling from rest, q_1 = -l log cosh(T sqrt(g / l)).
TEST(NewProblemTutorial, FallFromRestHasItsClosedForm) {
  const double x[] = {0.0, 0.0};
  double y[2];
  ASSERT_TRUE(Flight()(x, y));
  const double exact =
      -Flight::kDragLength *
      std::log(std::cosh(Flight::kTime *
                         std::sqrt(Flight::kGravity / Flight::kDragLength)));
  EXPECT_EQ(y[0], 0.0);
  // Order 4 with h = 0.02 s, in units of l / sqrt(g l) = 0.7 s: about
  // (0.02 / 0.7)^4 = 7e-7, and constants below one.
  EXPECT_NEAR(y[1], exact, 1e-6);
}

// What compare --list_markdown prints for docs/rules.md or docs/problems.md.
std::string PrintedPage(const std::string& page) {
  const TemporaryFolder folder;
  const std::string printed = folder / (page + ".md");
  const std::string command =
      BinDir() + "/compare --list_markdown=" + page + " > " + printed;
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
  return Read(printed);
}

// docs/rules.md and docs/problems.md are printed from the tables.
TEST(Docs, GeneratedPagesAreCurrent) {
  for (const std::string page : {"rules", "problems"}) {
    EXPECT_EQ(PrintedPage(page), Read(kRoot / "docs" / (page + ".md")))
        << "docs/" << page << ".md is not what compare --list_markdown=" << page
        << " prints";
  }
}

// The cells of a row of a Markdown table: "\\|" does not end one.
int NumCells(const std::string& row) {
  int num_bars = 0;
  for (size_t i = 0; i < row.size(); ++i) {
    if (row[i] == '|' && (i == 0 || row[i - 1] != '\\')) ++num_bars;
  }
  return num_bars - 1;
}

TEST(Docs, RowsOfGeneratedTablesHaveAsManyCellsAsTheirHeaders) {
  EXPECT_EQ(NumCells("| a | \\|b\\| |"), 2);
  for (const std::string page : {"rules", "problems"}) {
    int num_cells = 0;  // of the table's header; 0 outside of tables
    int num_options = 0;
    for (const std::string& line : SplitLines(PrintedPage(page))) {
      if (line.empty() || line[0] != '|') {
        num_cells = 0;
        continue;
      }
      if (num_cells == 0) num_cells = NumCells(line);
      EXPECT_EQ(NumCells(line), num_cells) << page << ": " << line;
      if (num_cells == 4) ++num_options;
    }
    EXPECT_GT(num_options, 30) << page;
  }
}

}  // namespace
}  // namespace invgrad
