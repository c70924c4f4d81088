// The documentation says what the code says: quotations and generated pages are
// current, links and names of files lead somewhere.

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "problems/torch/torch_networks.h"
#include "tests/docs/pages.h"
#include "tests/support/source_tree.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace docs_test {

namespace fs = std::filesystem;

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
    if (line.find("```") == line.find_first_not_of(' ') &&
        line.find("```") != std::string::npos) {
      is_code = !is_code;
    } else if (!is_code) {
      text += line + "\n";
    }
  }
  return text;
}

// A target of [text](target) or ![text](target) that is no address: a file,
// empty for the page itself, and a section, empty for all of it.
struct Link {
  std::string file;
  std::string section;

  bool operator==(const Link& other) const {
    return file == other.file && section == other.section;
  }
};

std::vector<Link> RelativeLinks(const std::string& whole_page) {
  const std::string page = WithoutCode(whole_page);
  std::vector<Link> links;
  for (size_t at = page.find("]("); at != std::string::npos;
       at = page.find("](", at + 2)) {
    const size_t end = page.find(')', at);
    const std::string target = page.substr(at + 2, end - at - 2);
    if (target.find("://") != std::string::npos) continue;
    const size_t hash = std::min(target.find('#'), target.size());
    links.push_back({target.substr(0, hash),
                     target.substr(std::min(hash + 1, target.size()))});
  }
  return links;
}

// The name of a heading in a link: small letters, digits, _, and - for a space.
// Other than ASCII is left out here, of names as well.
std::string SectionName(const std::string& heading) {
  std::string name;
  for (const char c : heading) {
    const unsigned char byte = static_cast<unsigned char>(c);
    if (byte < 128 && (std::isalnum(byte) != 0 || c == '-' || c == '_')) {
      name += static_cast<char>(std::tolower(byte));
    } else if (c == ' ') {
      name += '-';
    }
  }
  return name;
}

std::set<std::string> SectionNames(const std::string& page) {
  std::set<std::string> names;
  for (const std::string& line : SplitLines(WithoutCode(page))) {
    const size_t level = line.find_first_not_of('#');
    if (level == 0 || level == std::string::npos || line[level] != ' ')
      continue;
    names.insert(SectionName(line.substr(level + 1)));
  }
  return names;
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
  EXPECT_EQ(RelativeLinks(page),
            (std::vector<Link>{{"b.md", "c"}, {"e.png", ""}, {"", "i"}}));
  EXPECT_EQ(SectionNames("## 1. What `x` is, 8 \u00d7 8\n#no\n"),
            (std::set<std::string>{"1-what-x-is-8--8"}));
  const std::vector<Quotation> quotations = Quotations(page);
  ASSERT_EQ(quotations.size(), 1u);
  EXPECT_EQ(quotations[0].file, "j.cc");
  EXPECT_EQ(quotations[0].marker, "k");
  EXPECT_EQ(quotations[0].text, "l\n\n[m](o)\n");
}

TEST(Docs, QuotationsAreCurrent) {
  int num_quotations = 0;
  for (const fs::path& page : Pages()) {
    for (const Quotation& quotation : Quotations(ReadText(page))) {
      SCOPED_TRACE(page.string() + ": " + quotation.file + ": " +
                   quotation.marker);
      EXPECT_EQ(quotation.text,
                MarkedRegion(ReadText(page.parent_path() / quotation.file),
                             quotation.marker));
      ++num_quotations;
    }
  }
  EXPECT_GT(num_quotations, 0);
}

TEST(Docs, LinksLeadToFilesAndSections) {
  int num_links = 0;
  for (const fs::path& page : Pages()) {
    const std::string text = ReadText(page);
    for (const Link& link : RelativeLinks(text)) {
      const fs::path file = page.parent_path() / link.file;
      EXPECT_TRUE(fs::exists(file)) << page << " links to " << link.file;
      if (!link.section.empty() && fs::exists(file)) {
        const std::string target = link.file.empty() ? text : ReadText(file);
        EXPECT_EQ(SectionNames(target).count(SectionName(link.section)), 1u)
            << page << ": no section " << link.section << " in " << file;
      }
      ++num_links;
    }
  }
  EXPECT_GT(num_links, 0);
}

// The names of all headers and sources.
std::set<std::string> SourceNames() {
  std::set<std::string> names;
  for (const char* folder : {"bin", "docs", "lib", "problems", "tests"}) {
    for (const auto& entry :
         fs::recursive_directory_iterator(SourceRoot() / folder)) {
      names.insert(entry.path().filename().string());
    }
  }
  return names;
}

// Paths from the root, and headers by their names alone.
TEST(Docs, FilesInTheTextExist) {
  const std::regex path("`((bin|docs|lib|problems|tests)/[A-Za-z0-9_./]+)`");
  const std::regex header("[a-z0-9_]+\\.h\\b");
  const std::set<std::string> names = SourceNames();
  int num_files = 0;
  for (const fs::path& page : Pages()) {
    const std::string text = WithoutCode(ReadText(page));
    using Matches = std::sregex_iterator;
    for (Matches at(text.begin(), text.end(), path); at != Matches(); ++at) {
      const std::string file = (*at)[1];
      EXPECT_TRUE(fs::exists(SourceRoot() / file)) << page << " names " << file;
      ++num_files;
    }
    for (Matches at(text.begin(), text.end(), header); at != Matches(); ++at) {
      const std::string name = at->str();
      EXPECT_TRUE(names.count(name) > 0) << page << " names " << name;
      ++num_files;
    }
  }
  EXPECT_GT(num_files, 0);
}

// What compare prints with a flag.
std::string Printed(const std::string& flag) {
  const TemporaryFolder folder;
  const std::string printed = folder / "printed";
  const std::string command = BinDir() + "/compare " + flag + " > " + printed;
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
  return ReadText(printed);
}

// docs/rules.md or docs/problems.md.
std::string GeneratedPage(const std::string& page) {
  return ReadText(SourceRoot() / "docs" / (page + ".md"));
}

TEST(Docs, GeneratedPagesAreCurrent) {
  for (const std::string page : {"rules", "problems"}) {
    // Without libtorch the problems say which of their networks are not built.
    if (page == "problems" && !HasTorch()) continue;
    EXPECT_EQ(Printed("--list_markdown=" + page), GeneratedPage(page))
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
    for (const std::string& line : SplitLines(GeneratedPage(page))) {
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

// A section of a page, up to the next one; empty if there is none.
std::string Section(const std::string& page, const std::string& name) {
  const std::string heading = "## " + name + "\n";
  const size_t begin = page.find(heading);
  if (begin == std::string::npos) return "";
  const size_t end = page.find("\n#", begin + heading.size());
  return page.substr(begin, end - begin);
}

bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

// Options that many rows share stand once, above the sections.
TEST(Docs, SectionsAndCommonOptionsSayWhatTheListingSays) {
  const std::regex entry("  (\\w+)");
  const std::regex option("      (\\w+)=(\\S*) .*");
  const std::string rules = GeneratedPage("rules");
  const std::string problems = GeneratedPage("problems");
  std::string section;
  std::string common;
  int num_options = 0;
  for (const std::string& line : SplitLines(Printed("--list"))) {
    std::smatch match;
    if (std::regex_match(line, match, entry)) {
      const std::string& page =
          Section(rules, match[1]).empty() ? problems : rules;
      section = Section(page, match[1]);
      common = Section(page, "Common options");
      EXPECT_FALSE(section.empty()) << line;
    } else if (std::regex_match(line, match, option)) {
      const std::string name = match[1];
      const std::string row = "| `" + name + "` | " + match[2].str() + " |";
      EXPECT_TRUE(Contains(section, row) ||
                  Contains(section, "`" + name + "=" + match[2].str() + "`") ||
                  (Contains(section, "`" + name + "`") &&
                   !Contains(section, "| `" + name + "`") &&
                   Contains(common, row)))
          << line << " is not in\n"
          << section;
      ++num_options;
    }
  }
  EXPECT_GT(num_options, 300);
}

TEST(Docs, CommonOptionsHaveOneMeaning) {
  for (const std::string page : {"rules", "problems"}) {
    const std::string common = Section(GeneratedPage(page), "Common options");
    std::set<std::string> names;
    for (const std::string& line : SplitLines(common)) {
      if (line.rfind("| `", 0) != 0) continue;
      EXPECT_TRUE(names.insert(line.substr(0, line.find("` |"))).second)
          << page << ": " << line;
    }
    EXPECT_GT(names.size(), 10u) << page;
  }
}

}  // namespace docs_test
}  // namespace invgrad
