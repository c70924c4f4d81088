#include "report/html_report.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "fmt/core.h"
#include "invgrad/io/atomic_file.h"
#include "report/html_charts.h"
#include "report/html_script.h"
#include "report/html_style.h"

namespace invgrad {
namespace {

std::string Base64(const std::string& bytes) {
  constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    unsigned group = 0;
    for (size_t k = i; k < i + 3; ++k) {
      group = 256 * group +
              (k < bytes.size() ? static_cast<unsigned char>(bytes[k]) : 0u);
    }
    for (size_t k = 0; k < 4; ++k) {
      text += i + k > bytes.size() ? '=' : kDigits[group >> (18 - 6 * k) & 63u];
    }
  }
  return text;
}

std::string Element(const std::string& tag,
                    const std::string& text,
                    const std::string& of_class = "") {
  if (text.empty()) return "";
  return of_class.empty()
             ? fmt::format("<{0}>{1}</{0}>\n", tag, EscapeHtml(text))
             : fmt::format("<{0} class=\"{2}\">{1}</{0}>\n",
                           tag,
                           EscapeHtml(text),
                           of_class);
}

// The short name, with the full one when the pointer is on it.
std::string NameCell(const std::string& label, const HtmlReport& report) {
  for (const HtmlReport::Method& method : report.methods) {
    if (method.label == label && method.name != label) {
      return fmt::format("<abbr title=\"{}\">{}</abbr>",
                         EscapeHtml(label),
                         EscapeHtml(method.name));
    }
  }
  return EscapeHtml(label);
}

// "0.25" or "3 of 5"; otherwise NaN.
double NumberOf(const std::string& cell) {
  char* end = nullptr;
  const double value = std::strtod(cell.c_str(), &end);
  const std::string rest = end;
  const bool is_number =
      end != cell.c_str() && (rest.empty() || rest.compare(0, 4, " of ") == 0);
  return is_number ? value : std::nan("");
}

// NaN if fewer than two cells are numbers.
double BestOf(const HtmlReport::Sheet& sheet, size_t column) {
  const auto& rows = sheet.table.rows();
  const auto has_title = [&](const std::vector<std::string>& titles) {
    return std::count(titles.begin(), titles.end(), rows[0][column]) > 0;
  };
  const bool is_least = has_title(sheet.least);
  double best = std::nan("");
  if (!is_least && !has_title(sheet.greatest)) return best;
  int num_numbers = 0;
  for (size_t i = 1; i < rows.size(); ++i) {
    const double value = NumberOf(rows[i][column]);
    if (std::isnan(value)) continue;
    ++num_numbers;
    best = is_least ? std::fmin(best, value) : std::fmax(best, value);
  }
  return num_numbers > 1 ? best : std::nan("");
}

std::string SheetHtml(const HtmlReport::Sheet& sheet,
                      const HtmlReport& report) {
  const auto& rows = sheet.table.rows();
  const auto& aligns = sheet.table.aligns();
  std::string head, body;
  std::vector<double> best;
  for (size_t j = 0; j < aligns.size(); ++j) {
    best.push_back(BestOf(sheet, j));
    head += fmt::format("<th{}><button>{}</button></th>",
                        aligns[j] == Table::Align::kLeft ? " class=left" : "",
                        NameCell(rows[0][j], report));
  }
  for (size_t i = 1; i < rows.size(); ++i) {
    body += "<tr>";
    for (size_t j = 0; j < aligns.size(); ++j) {
      const bool is_left = aligns[j] == Table::Align::kLeft;
      constexpr size_t kLongText = 24;
      const char* of_class = NumberOf(rows[i][j]) == best[j] ? " class=best"
                             : is_left && rows[i][j].size() > kLongText && j > 0
                                 ? " class=\"left words\""
                             : is_left ? " class=left"
                                       : "";
      body += fmt::format(
          "<td{}>{}</td>",
          of_class,
          is_left ? NameCell(rows[i][j], report) : EscapeHtml(rows[i][j]));
    }
    body += "</tr>\n";
  }
  const std::string table = fmt::format(
      "<div class=scroll><table class=sorts><thead><tr>{}</tr></thead>\n"
      "<tbody>\n{}</tbody></table></div>\n",
      head,
      body);
  const std::string caption = Element("p", sheet.caption, "caption");
  return sheet.is_folded ? fmt::format(
                               "<details><summary>{}</summary>\n{}{}"
                               "</details>\n",
                               EscapeHtml(sheet.title),
                               caption,
                               table)
                         : Element("h2", sheet.title) + caption + table;
}

std::string ImagesHtml(const std::vector<HtmlReport::Image>& images) {
  size_t room = 1'150'000;  // bytes, which are 1.53 MB as text
  std::string figures;
  for (const HtmlReport::Image& image : images) {
    std::string png, ignored;
    if (!ReadFile(image.path_png, &png, &ignored)) continue;
    const std::string caption = EscapeHtml(image.caption);
    if (png.size() > room) {
      const size_t slash = image.path_png.rfind('/');
      figures +=
          fmt::format("<p class=caption>{} (too large for this page: {})</p>\n",
                      caption,
                      EscapeHtml(image.path_png.substr(slash + 1)));
      continue;
    }
    room -= png.size();
    figures += fmt::format(
        "<figure><img alt=\"{0}\" src=\"data:image/png;base64,{1}\">"
        "<figcaption class=caption>{0}</figcaption></figure>\n",
        caption,
        Base64(png));
  }
  return figures.empty() ? ""
                         : "<h2>Pictures</h2>\n<div class=pictures>\n" +
                               figures + "</div>\n";
}

std::string TopHtml(const HtmlReport& report) {
  std::string html = Element("h1", report.title) +
                     Element("p", report.question, "question") +
                     Element("p", report.progress, "live") +
                     Element("p", report.answer, "answer");
  if (!report.warnings.empty()) {
    constexpr size_t kMaxShown = 20;
    const size_t num_all = report.warnings.size();
    const size_t num_shown = std::min(num_all, kMaxShown);
    html += "<div class=warnings>What failed or is missing:\n<ul>\n";
    for (size_t i = 0; i < num_shown; ++i) {
      html += Element("li", report.warnings[i]);
    }
    html += "</ul></div>\n";
    if (num_shown < num_all) {
      html += Element("p", fmt::format("and {} more", num_all - num_shown));
    }
  }
  html += Element("pre", report.command);
  if (!report.facts.empty()) {
    html += "<dl>\n";
    for (const auto& [name, value] : report.facts) {
      html += Element("dt", name) + Element("dd", value);
    }
    html += "</dl>\n";
  }
  return html;
}

}  // namespace

std::string EscapeHtml(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '&':
        escaped += "&amp;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string ToHtml(const HtmlReport& report) {
  std::string html = fmt::format(
      "<!DOCTYPE html>\n<html lang=en>\n<head>\n<meta charset=utf-8>\n"
      "<meta name=viewport content=\"width=device-width, initial-scale=1\">\n"
      "{}<title>{}</title>\n<style>{}</style>\n</head>\n<body>\n{}",
      report.progress.empty() ? "" : "<meta http-equiv=refresh content=10>\n",
      EscapeHtml(report.title),
      kHtmlStyle,
      TopHtml(report));
  for (const HtmlReport::Chart& chart : report.charts) {
    if (chart.views.empty()) continue;
    html += Element("h2", chart.title) +
            Element("p", chart.caption, "caption") +
            "<figure class=chart><noscript>The curves need JavaScript."
            "</noscript></figure>\n";
  }
  for (const HtmlReport::Sheet& sheet : report.sheets) {
    html += SheetHtml(sheet, report);
  }
  for (const HtmlReport::Maps& maps : report.maps) html += MapsHtml(maps);
  return html + ImagesHtml(report.images) +
         "<script type=\"application/json\" id=data>" + ChartsJson(report) +
         "</script>\n<script>" + kHtmlScript + "</script>\n</body>\n</html>\n";
}

}  // namespace invgrad
