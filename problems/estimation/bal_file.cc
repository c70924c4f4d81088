#include "problems/estimation/bal_file.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>

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

// Real files shrink to a quarter, a bomb by a factor of 20,000.
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
    if (!ParseCounts() || !ParseObservations(&read.observations)) {
      return false;
    }
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
    // "0 0 0 0\n" and "0\n" are the shortest that they can be; the last line
    // needs no end. No product overflows: counts have 31 bits.
    const long min_size =
        8 * num_observations_ +
        2 * (kCameraSize * num_cameras_ + kPointSize * num_points_) - 1;
    if (cursor_.num_bytes_left() < min_size) {
      return cursor_.Fail(
          "the text is too short for " + std::to_string(num_cameras_) +
              " cameras, " + std::to_string(num_points_) + " points and " +
              std::to_string(num_observations_) + " observations",
          "at least " + std::to_string(min_size) +
              " bytes behind this line, not " +
              std::to_string(cursor_.num_bytes_left()));
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
      if (!cursor_.ReadNumber(expected, values->data() + i)) {
        return false;
      }
    }
    return true;
  }

  TextCursor cursor_;
  long num_cameras_ = 0;
  long num_points_ = 0;
  long num_observations_ = 0;
};

template <typename Matrix>
void AppendValues(const Matrix& values, std::string* text) {
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    AppendNumber(values.data()[i], text);
    *text += '\n';
  }
}

}  // namespace

bool ParseBal(const std::string& text,
              const std::string& file,
              BalData* data,
              std::string* error) {
  return BalParser(text, file, error).Parse(data);
}

std::string BalText(const BalData& data) {
  std::string text;
  AppendNumber(static_cast<long>(data.cameras.cols()), &text);
  text += ' ';
  AppendNumber(static_cast<long>(data.points.cols()), &text);
  text += ' ';
  AppendNumber(static_cast<long>(data.observations.size()), &text);
  text += '\n';
  for (const BalData::Observation& observation : data.observations) {
    AppendNumber(static_cast<long>(observation.camera), &text);
    text += ' ';
    AppendNumber(static_cast<long>(observation.point), &text);
    text += ' ';
    AppendNumber(observation.x, &text);
    text += ' ';
    AppendNumber(observation.y, &text);
    text += '\n';
  }
  AppendValues(data.cameras, &text);
  AppendValues(data.points, &text);
  return text;
}

bool CheckBal(const BalData& data, std::string* error) {
  if (data.observations.empty() || data.cameras.cols() == 0 ||
      data.points.cols() == 0) {
    *error = "there is no observation, camera or point";
    return false;
  }
  for (const BalData::Observation& observation : data.observations) {
    if (observation.camera < 0 || observation.camera >= data.cameras.cols() ||
        observation.point < 0 || observation.point >= data.points.cols()) {
      *error = "an observation is of camera " +
               std::to_string(observation.camera) + " and point " +
               std::to_string(observation.point) + "; there are " +
               std::to_string(data.cameras.cols()) + " and " +
               std::to_string(data.points.cols());
      return false;
    }
    if (!std::isfinite(observation.x) || !std::isfinite(observation.y)) {
      *error = "an observation is not finite";
      return false;
    }
  }
  if (!data.cameras.allFinite() || !data.points.allFinite()) {
    *error = "a camera or a point is not finite";
    return false;
  }
  return true;
}

bool ReadBalFile(const std::string& path, BalData* data, std::string* error) {
  std::string bytes;
  if (!ReadFile(path, &bytes, error)) {
    return false;
  }
  if (!IsBzip2(path)) {
    return ParseBal(bytes, path, data, error);
  }
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
  std::string problem;
  if (!CheckBal(data, &problem)) {
    *error = "cannot write " + path + ": " + problem;
    return false;
  }
  const std::string text = BalText(data);
  if (!IsBzip2(path)) {
    return WriteFile(path, text, error);
  }
  std::string bytes;
  if (!CompressBzip2(text, &bytes, &problem)) {
    *error = "cannot write " + path + ": " + problem;
    return false;
  }
  if (text.size() > MaxTextSize(bytes.size())) {
    *error = "cannot write " + path +
             ": compressed, so long a text would not be read again";
    return false;
  }
  return WriteFile(path, bytes, error);
}

}  // namespace invgrad
