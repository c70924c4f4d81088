// What a run leaves in its directory (run_directory.h): tables and pictures.
#ifndef BIN_SUPPORT_RUN_OUTPUT_H_
#define BIN_SUPPORT_RUN_OUTPUT_H_

#include <limits>
#include <string>
#include <vector>

#include "bin/support/run_directory.h"
#include "invgrad/train.h"
#include "report/plot.h"
#include "report/table.h"

namespace invgrad {

// "half_inverse:truncation=1e-6" -> "half_inverse-truncation-1e-6". A label of
// more than 180 characters is cut, and ends in a digest of all of it, so that
// file systems accept the name, with what is put before and after it.
std::string FileName(const std::string& label);

// Writes PATH.txt and PATH.md.
bool WriteTable(const std::string& path,
                const Table& table,
                std::string* error);

struct Picture {
  std::string path_png;
  std::vector<Plot> panels;
  int num_columns = 0;  // as of WritePlots
  // What to see in it, for report.html; empty: the report does not show it.
  std::string caption = "";
};

// Draws the pictures if --plots is set; a picture without panels only removes
// an earlier one. Call it when all tables and files are written: a failure to
// draw is a warning, and a signal ends the drawing. After a picture that takes
// longer than a minute, the others have five seconds each.
void DrawPictures(const std::vector<Picture>& pictures);

// A field of the history against seconds of training, or against steps. A
// logarithmic axis cannot show zero: the initial loss is left out.
Series HistoryCurve(const std::string& title,
                    const History& history,
                    double HistoryRow::*field,
                    bool against_seconds);
// The curve of a failed run ends in no value.
void EndFailedCurve(bool has_failed, Series* curve);

// Values of runs that differ in the seed alone. A value that is not finite is a
// failed run, which counts as worst.
struct SeedSpread {
  explicit SeedSpread(const std::vector<double>& values);

  // "0.1 - 0.3, 1 of 3 failed or not run"
  std::string Text() const;
  // Of all runs: infinity if one failed.
  double Highest() const {
    return num_failed > 0 ? std::numeric_limits<double>::infinity() : high;
  }

  size_t num_runs = 0;
  size_t num_failed = 0;
  // The position of the median; of an even number, of the lower of the two.
  size_t median_run = 0;
  // NaN if that run failed, or all runs.
  double median;
  double low;
  double high;
};

}  // namespace invgrad

#endif  // BIN_SUPPORT_RUN_OUTPUT_H_
