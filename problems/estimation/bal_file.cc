#include "problems/estimation/bal_file.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string_view>
#include <utility>

#include "fmt/format.h"
#include "invgrad/io/atomic_file.h"
#include "problems/estimation/bzip2.h"
#include "problems/estimation/text_cursor.h"

namespace invgrad {
namespace {

constexpr long kMaxCount = std::numeric_limits<int>::max();

// bzip2 compresses real files by a factor of four, a decompression bomb by
// 20,000.
size_t MaxTextSize(size_t compressed_size) {
  constexpr size_t kMebibyte = size_t{1} << 20;
  return std::min(2048 * kMebibyte,
                  std::max(64 * kMebibyte, 100 * compressed_size));
}

}  // namespace

bool ParseBal(const std::string& text,
              const std::string& file,
              BalData* data,
              std::string* error) {
  TextCursor cursor(text, file, error);
  cursor.NextLine();
  const long num_cameras =
      cursor.Integer("the number of cameras", 1, kMaxCount);
  const long num_points = cursor.Integer("the number of points", 1, kMaxCount);
  const long num_observations =
      cursor.Integer("the number of observations", 1, kMaxCount);
  cursor.EndLine();
  // The shortest lines are "0 0 0 0\n" and "0\n"; the last line needs no end.
  // Products do not overflow, because counts have 31 bits.
  const long min_size =
      8 * num_observations + 2 * (9 * num_cameras + 3 * num_points) - 1;
  if (cursor.num_bytes_left() < min_size) {
    cursor.Fail(
        fmt::format("the text is too short for {} cameras, {} points and {} "
                    "observations",
                    num_cameras,
                    num_points,
                    num_observations),
        fmt::format("at least {} bytes after this line, not {}",
                    min_size,
                    cursor.num_bytes_left()));
  }
  if (!cursor.ok()) return false;  // before memory is allocated
  BalData read;
  read.observations.resize(num_observations);
  const auto skip_blank_lines = [&cursor] {
    while (cursor.PeekToken().empty() && cursor.NextLine()) {
    }
  };
  for (auto& [camera, point, x, y] : read.observations) {
    skip_blank_lines();
    camera = static_cast<int>(
        cursor.Integer("an observation's camera", 0, num_cameras - 1));
    point = static_cast<int>(
        cursor.Integer("an observation's point", 0, num_points - 1));
    x = cursor.Number("an observation's x");
    y = cursor.Number("an observation's y");
    cursor.EndLine();
  }
  const auto read_value = [&](const char* expected) {
    skip_blank_lines();
    return cursor.Number(expected);
  };
  read.cameras.resize(9, num_cameras);
  for (double& value : read.cameras.reshaped()) {
    value = read_value("a camera's value");
  }
  read.points.resize(3, num_points);
  for (double& value : read.points.reshaped()) {
    value = read_value("a point's coordinate");
  }
  cursor.EndText();
  if (cursor.ok()) *data = std::move(read);
  return cursor.ok();
}

std::string BalText(const BalData& data) {
  std::string text;
  const auto out = std::back_inserter(text);
  fmt::format_to(out,
                 "{} {} {}\n",
                 data.cameras.cols(),
                 data.points.cols(),
                 data.observations.size());
  for (const auto& [camera, point, x, y] : data.observations) {
    fmt::format_to(out, "{} {} {} {}\n", camera, point, x, y);
  }
  const auto write_values = [out](const auto& values) {
    for (const double value : values.reshaped()) {
      fmt::format_to(out, "{}\n", value);
    }
  };
  write_values(data.cameras);
  write_values(data.points);
  return text;
}

bool ReadBalFile(const std::string& path, BalData* data, std::string* error) {
  std::string bytes;
  if (!ReadFile(path, &bytes, error)) return false;
  if (!EndsWith(path, ".bz2")) return ParseBal(bytes, path, data, error);
  std::string text;
  std::string problem;
  if (!DecompressBzip2(bytes, MaxTextSize(bytes.size()), &text, &problem)) {
    *error = path + ": " + problem;
    return false;
  }
  return ParseBal(text, path, data, error);
}

bool WriteBalFile(const std::string& path,
                  const BalData& data,
                  std::string* error) {
  return WriteReadable(path, data, BalText, ParseBal, error);
}

}  // namespace invgrad
