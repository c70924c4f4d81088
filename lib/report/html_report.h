// A report of a run as one HTML file, for people: what was asked, the answer,
// curves, tables, maps and pictures. It reads nothing but itself, so that it
// opens by a double click and can be sent. Static pictures for papers: plot.h.
//
// A chart shows one of its views at a time; html_script.h says what a reader can
// do with it. Its script is JavaScript; texts, tables, maps and pictures need
// none. Every text is escaped, and bytes that are not UTF-8 are replaced.
//
// Size:    long curves are thinned, to 200 points each, and to fewer where there
//          are many; pictures beyond 1.15 MB in all are left out, with a line
//          that names the file.
// Cost:    linear in the points of the curves and the bytes of the pictures.
#ifndef REPORT_HTML_REPORT_H_
#define REPORT_HTML_REPORT_H_

#include <string>
#include <utility>
#include <vector>

#include "report/plot.h"
#include "report/table.h"

namespace invgrad {

struct HtmlReport {
  // What tables and curves show by its short name, with the full specification
  // when the pointer is on it. Method i is Series::color i.
  struct Method {
    std::string name;   // "adam"
    std::string label;  // "adam:step_size=1e-3"
  };

  // The views are plots without heat maps. They are chosen by what differs
  // between them: title, y_label and x_label. A series that is no method has
  // the color -1 and its title. Values above y_range.high are cut off.
  struct Chart {
    std::string title;
    std::string caption;
    std::vector<Plot> views;
    bool has_steps = false;  // y keeps its value until the next point
  };

  struct Sheet {
    std::string title;
    std::string caption;
    Table table;
    // The titles of columns whose least or greatest cell is marked.
    std::vector<std::string> least;
    std::vector<std::string> greatest;
    bool is_folded = false;  // a click shows it
  };

  // Plots with a heat map each, over the same axes. At each place the panel
  // with the lowest value is marked.
  struct Maps {
    std::string title;
    std::string caption;
    std::vector<Plot> panels;
  };

  struct Image {
    std::string path_png;
    std::string caption;
  };

  std::string title;     // "compare: oscillator_chain"
  std::string question;  // a sentence
  std::string answer;    // a paragraph; empty: there is none yet
  // Of a run that goes on, "3 of 45 runs are done": a browser then reads the
  // file again every 10 seconds. Empty: the run is over.
  std::string progress;
  std::vector<std::string> warnings;  // what is missing, and why
  std::string command;                // which repeats the run
  std::vector<std::pair<std::string, std::string>> facts;  // name, value
  std::vector<Method> methods;
  std::vector<Chart> charts;
  std::vector<Sheet> sheets;
  std::vector<Maps> maps;
  std::vector<Image> images;  // those that do not exist are left out
};

std::string ToHtml(const HtmlReport& report);

// The text with "<", ">", "&" and quotes as HTML writes them.
std::string EscapeHtml(const std::string& text);

}  // namespace invgrad

#endif  // REPORT_HTML_REPORT_H_
