#include "bin/support/run_output.h"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <limits>
#include <numeric>

#include "bin/support/output_options.h"
#include "bin/support/program.h"
#include "fmt/core.h"
#include "invgrad/io/digest.h"
#include "invgrad/io/format.h"
#include "report/interrupt.h"

namespace invgrad {

std::string FileName(const std::string& label) {
  std::string name;
  for (const char c : label) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(c)) != 0 ||
                          c == '_' || c == '.' || c == '+' || c == '-';
    name += is_plain ? c : '-';
  }
  constexpr size_t kMaxSize = 180;
  if (name.size() <= kMaxSize) return name;
  const std::string end = "-" + Digest().Add(label).Hex();
  return name.substr(0, kMaxSize - end.size()) + end;
}

bool WriteTable(const std::string& path,
                const Table& table,
                std::string* error) {
  return WriteRunFile(path + ".txt", table.ToText(), error) &&
         WriteRunFile(path + ".md", table.ToMarkdown(), error);
}

void DrawPictures(const std::vector<Picture>& pictures) {
  if (!Output().plots) return;
  std::cout << std::flush;  // before what may take long
  const int signal_before = Interrupt::Signal();
  double max_seconds = 60.0;
  for (const Picture& picture : pictures) {
    std::filesystem::path script = picture.path_png, data = picture.path_png;
    script.replace_extension(".gp");
    data.replace_extension(".csv");
    std::error_code ignored;
    std::filesystem::remove(picture.path_png, ignored);
    std::string error;
    if (!ListRunFile(picture.path_png, &error) ||
        !ListRunFile(script, &error) || !ListRunFile(data, &error)) {
      Warn(error);
      return;
    }
    const auto start = std::chrono::steady_clock::now();
    if (picture.panels.empty() || WritePlots(picture.path_png,
                                             picture.panels,
                                             &error,
                                             max_seconds,
                                             picture.num_columns)) {
      continue;
    }
    Warn(error);
    if (Interrupt::Signal() != signal_before) return;
    const std::chrono::duration<double> seconds =
        std::chrono::steady_clock::now() - start;
    if (seconds.count() > max_seconds) max_seconds = 5.0;
  }
}

Series HistoryCurve(const std::string& title,
                    const History& history,
                    double HistoryRow::*field,
                    bool against_seconds) {
  Series curve;
  curve.title = title;
  for (const HistoryRow& row : history) {
    if (row.step == 0) continue;
    curve.x.push_back(against_seconds ? row.seconds
                                      : static_cast<double>(row.step));
    curve.y.push_back(row.*field);
  }
  return curve;
}

void EndFailedCurve(bool has_failed, Series* curve) {
  if (has_failed && !curve->y.empty()) curve->y.back() = HistoryRow::kNone;
}

SeedSpread::SeedSpread(const std::vector<double>& values)
    : num_runs(values.size()) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  median = low = high = none;
  if (values.empty()) return;
  const auto rank = [&values](size_t i) {
    return std::isfinite(values[i]) ? values[i]
                                    : std::numeric_limits<double>::infinity();
  };
  std::vector<size_t> order(values.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&rank](size_t a, size_t b) {
    return rank(a) < rank(b);
  });
  median_run = order[(order.size() - 1) / 2];
  if (std::isfinite(values[median_run])) median = values[median_run];
  for (const double value : values) {
    if (std::isfinite(value)) {
      low = std::fmin(low, value);
      high = std::fmax(high, value);
    } else {
      ++num_failed;
    }
  }
}

std::string SeedSpread::Text() const {
  std::string text = NumberOrDash(low);
  if (low < high) text += " - " + FormatNumber(high);
  if (num_failed > 0) {
    text += fmt::format(", {} of {} failed or not run", num_failed, num_runs);
  }
  return text;
}

}  // namespace invgrad
