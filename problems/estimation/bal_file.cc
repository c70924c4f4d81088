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
constexpr int kCameraSize = 9;
constexpr int kPointSize = 3;

bool IsBzip2(std::string_view path) {
  constexpr std::string_view kEnding = ".bz2";
  return path.size() >= kEnding.size() &&
         path.substr(path.size() - kEnding.size()) == kEnding;
}

// bzip2 compresses real files by a factor of four, a decompression bomb by
// 20,000.
size_t MaxTextSize(size_t compressed_size) {
  constexpr size_t kMebibyte = size_t{1} << 20;
  return std::min(2048 * kMebibyte,
                  std::max(64 * kMebibyte, 100 * compressed_size));
}

class BalParser {
 public:
  BalParser(const std::string& text,
            const std::string& file,
            std::string* error)
      : cursor_(text, file, error) {}

  bool Parse(BalData* data) {
    BalData read;
    if (!ParseCounts() || !ParseObservations(&read.observations)) return false;
    read.cameras.resize(kCameraSize, num_cameras_);
    read.points.resize(kPointSize, num_points_);
    if (!ParseValues("a camera's value", &read.cameras) ||
        !ParseValues("a point's coordinate", &read.points) ||
        !cursor_.ReadTextEnd()) {
      return false;
    }
    *data = std::move(read);
    return true;
  }

 private:
  bool ParseCounts() {
    cursor_.NextLine();
    if (!cursor_.ReadInteger(
            "the number of cameras", 1, kMaxCount, &num_cameras_) ||
        !cursor_.ReadInteger(
            "the number of points", 1, kMaxCount, &num_points_) ||
        !cursor_.ReadInteger(
            "the number of observations", 1, kMaxCount, &num_observations_) ||
        !cursor_.ReadLineEnd()) {
      return false;
    }
    // The shortest lines are "0 0 0 0\n" and "0\n"; the last line needs no end.
    // Products do not overflow, because counts have 31 bits.
    const long min_size =
        8 * num_observations_ +
        2 * (kCameraSize * num_cameras_ + kPointSize * num_points_) - 1;
    if (cursor_.num_bytes_left() < min_size) {
      return cursor_.Fail(
          fmt::format("the text is too short for {} cameras, {} points and {} "
                      "observations",
                      num_cameras_,
                      num_points_,
                      num_observations_),
          fmt::format("at least {} bytes behind this line, not {}",
                      min_size,
                      cursor_.num_bytes_left()));
    }
    return true;
  }

  bool ParseObservations(std::vector<BalData::Observation>* observations) {
    observations->resize(num_observations_);
    for (BalData::Observation& observation : *observations) {
      long camera = 0;
      long point = 0;
      cursor_.NextLine();
      if (!cursor_.ReadInteger(
              "an observation's camera", 0, num_cameras_ - 1, &camera) ||
          !cursor_.ReadInteger(
              "an observation's point", 0, num_points_ - 1, &point) ||
          !cursor_.ReadNumber("an observation's x", &observation.x) ||
          !cursor_.ReadNumber("an observation's y", &observation.y) ||
          !cursor_.ReadLineEnd()) {
        return false;
      }
      observation.camera = static_cast<int>(camera);
      observation.point = static_cast<int>(point);
    }
    return true;
  }

  // All entries, column by column.
  template <typename Matrix>
  bool ParseValues(std::string_view expected, Matrix* values) {
    for (Eigen::Index i = 0; i < values->size(); ++i) {
      while (cursor_.PeekToken().empty() && cursor_.NextLine()) {
      }
      if (!cursor_.ReadNumber(expected, values->data() + i)) return false;
    }
    return true;
  }

  TextCursor cursor_;
  long num_cameras_ = 0;
  long num_points_ = 0;
  long num_observations_ = 0;
};

}  // namespace

bool ParseBal(const std::string& text,
              const std::string& file,
              BalData* data,
              std::string* error) {
  return BalParser(text, file, error).Parse(data);
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
  for (const double value : data.cameras.reshaped()) {
    fmt::format_to(out, "{}\n", value);
  }
  for (const double value : data.points.reshaped()) {
    fmt::format_to(out, "{}\n", value);
  }
  return text;
}

bool ReadBalFile(const std::string& path, BalData* data, std::string* error) {
  std::string bytes;
  if (!ReadFile(path, &bytes, error)) return false;
  if (!IsBzip2(path)) return ParseBal(bytes, path, data, error);
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
