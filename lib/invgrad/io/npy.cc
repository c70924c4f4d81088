#include "invgrad/io/npy.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string_view>
#include <utility>
#include <vector>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/io/atomic_file.h"

namespace invgrad {
namespace {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
              "doubles are copied to and from little-endian files as they are");

constexpr std::string_view kMagic("\x93NUMPY", 6);

struct NpyHeader {
  std::string type;  // such as "<f8"
  bool is_fortran_order = false;
  std::vector<std::int64_t> shape;
};

// Parses the Python literal of a header,
//   {'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }
// with the keys in any order.
class HeaderParser {
 public:
  explicit HeaderParser(std::string_view text) : rest_(text) {}

  bool Parse(NpyHeader* header) {
    bool has_type = false;
    bool has_order = false;
    bool has_shape = false;
    if (!Take("{")) {
      return false;
    }
    while (!Take("}")) {
      std::string key;
      if (!ParseString(&key) || !Take(":")) {
        return false;
      }
      bool* seen = nullptr;
      bool is_read = false;
      if (key == "descr") {
        seen = &has_type;
        is_read = ParseType(&header->type);
      } else if (key == "fortran_order") {
        seen = &has_order;
        is_read = ParseBool(&header->is_fortran_order);
      } else if (key == "shape") {
        seen = &has_shape;
        is_read = ParseShape(&header->shape);
      }
      if (!is_read || *seen) {
        return false;
      }
      *seen = true;
      if (!Take(",") && !IsNext("}")) {
        return false;
      }
    }
    SkipSpace();
    return rest_.empty() && has_type && has_order && has_shape;
  }

 private:
  void SkipSpace() {
    rest_.remove_prefix(
        std::min(rest_.find_first_not_of(" \t\n"), rest_.size()));
  }

  bool IsNext(std::string_view token) {
    SkipSpace();
    return rest_.substr(0, token.size()) == token;
  }

  bool Take(std::string_view token) {
    if (!IsNext(token)) {
      return false;
    }
    rest_.remove_prefix(token.size());
    return true;
  }

  bool ParseString(std::string* value) {
    const char quote = IsNext("\"") ? '"' : '\'';
    if (!Take(std::string_view(&quote, 1))) {
      return false;
    }
    const size_t end = rest_.find(quote);
    if (end == std::string_view::npos) {
      return false;
    }
    *value = rest_.substr(0, end);
    rest_.remove_prefix(end + 1);
    return true;
  }

  // A structured type is a list of fields, kept as text for the message.
  bool ParseType(std::string* value) {
    if (!IsNext("[")) {
      return ParseString(value);
    }
    const size_t end = rest_.find(']');
    if (end == std::string_view::npos) {
      return false;
    }
    *value = rest_.substr(0, end + 1);
    rest_.remove_prefix(end + 1);
    return true;
  }

  bool ParseBool(bool* value) {
    *value = IsNext("True");
    return Take("True") || Take("False");
  }

  bool ParseShape(std::vector<std::int64_t>* shape) {
    if (!Take("(")) {
      return false;
    }
    while (!Take(")")) {
      SkipSpace();
      std::int64_t size = 0;
      const auto [end, status] =
          std::from_chars(rest_.data(), rest_.data() + rest_.size(), size);
      if (status != std::errc() || size < 0) {
        return false;
      }
      rest_.remove_prefix(end - rest_.data());
      Take("L");  // a long integer of Python 2
      shape->push_back(size);
      if (!Take(",") && !IsNext(")")) {
        return false;
      }
    }
    return true;
  }

  std::string_view rest_;
};

// Formats a shape like a Python tuple; -1 becomes "*".
std::string ShapeText(const std::vector<std::int64_t>& shape) {
  std::string text = "(";
  for (size_t i = 0; i < shape.size(); ++i) {
    text += i > 0 ? ", " : "";
    text += shape[i] < 0 ? "*" : std::to_string(shape[i]);
  }
  return text + (shape.size() == 1 ? ",)" : ")");
}

// Row by row.
bool WriteArray(const std::string& path,
                const std::vector<std::int64_t>& shape,
                const double* values,
                size_t num_values,
                std::string* error) {
  std::string header =
      "{'descr': '<f8', 'fortran_order': False, 'shape': " + ShapeText(shape) +
      ", }";
  // The total size of magic, version, length and header is a multiple of 64
  // bytes.
  constexpr size_t kPreamble = 10;
  constexpr size_t kAlignment = 64;
  const size_t used = (kPreamble + header.size() + 1) % kAlignment;
  header.append((kAlignment - used) % kAlignment, ' ');
  header += '\n';

  std::string bytes(kMagic);
  bytes += '\x01';
  bytes += '\0';
  bytes += static_cast<char>(header.size() & 0xff);
  bytes += static_cast<char>(header.size() >> 8);
  bytes += header;
  if (num_values > 0) {
    bytes.append(reinterpret_cast<const char*>(values),
                 num_values * sizeof(double));
  }
  return WriteFile(path, bytes, error);
}

// Splits a file into header and payload.
bool ParseFile(std::string_view bytes,
               NpyHeader* header,
               std::string_view* payload,
               std::string* problem) {
  if (bytes.substr(0, kMagic.size()) != kMagic) {
    *problem = "not a .npy file (it does not begin with \\x93NUMPY)";
    return false;
  }
  const auto byte = [&bytes](size_t i) {
    return static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[i]));
  };
  const std::string truncated =
      fmt::format("truncated in the header, at {} bytes", bytes.size());
  if (bytes.size() < 12) {  // magic, version and the longest length
    *problem = truncated;
    return false;
  }
  if (byte(6) < 1 || byte(6) > 3 || byte(7) != 0) {
    *problem = fmt::format(
        "found .npy version {}.{}, wanted 1.0, 2.0 or 3.0", byte(6), byte(7));
    return false;
  }
  const bool is_short = byte(6) == 1;
  const size_t begin = is_short ? 10 : 12;
  const size_t size =
      is_short ? byte(8) | byte(9) << 8
               : byte(8) | byte(9) << 8 | byte(10) << 16 | byte(11) << 24;
  if (size > bytes.size() - begin) {
    *problem = truncated;
    return false;
  }
  const std::string_view text = bytes.substr(begin, size);
  if (!HeaderParser(text).Parse(header)) {
    constexpr size_t kMaxShown = 120;
    const size_t end = text.find_last_not_of(" \n");
    *problem = fmt::format("cannot read its header: {}",
                           text.substr(0, std::min(end + 1, kMaxShown)));
    return false;
  }
  *payload = bytes.substr(begin + size);
  return true;
}

template <typename T>
Eigen::MatrixXd ToMatrix(std::string_view payload,
                         int rows,
                         int cols,
                         bool is_fortran_order) {
  // The payload need not be aligned for a T.
  using Columns = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>;
  Columns values = is_fortran_order ? Columns(rows, cols) : Columns(cols, rows);
  if (!payload.empty()) {
    std::memcpy(values.data(), payload.data(), payload.size());
  }
  if (!is_fortran_order) {
    values = Columns(values.transpose());
  }
  return values.template cast<double>();
}

// `wanted` describes the shape in messages, -1 for any size; `is_wanted` checks
// it.
template <typename IsWanted>
bool ReadArray(const std::string& path,
               const std::vector<std::int64_t>& wanted,
               const IsWanted& is_wanted,
               Eigen::MatrixXd* matrix,
               std::string* error) {
  CHECK(error != nullptr);
  std::string bytes;
  if (!ReadFile(path, &bytes, error)) {
    return false;
  }
  const auto fail = [&path, error](const std::string& problem) {
    *error = fmt::format("file {}: {}", path, problem);
    return false;
  };
  NpyHeader header;
  std::string_view payload;
  std::string problem;
  if (!ParseFile(bytes, &header, &payload, &problem)) {
    return fail(problem);
  }
  if (header.type != "<f8" && header.type != "<f4") {
    return fail(fmt::format(
        "found type '{}', wanted '<f8' or '<f4' (in Python: x.astype('<f8'))",
        header.type));
  }
  const std::vector<std::int64_t>& shape = header.shape;
  const auto fail_shape = [&] {
    return fail(fmt::format(
        "found shape {}, wanted {}", ShapeText(shape), ShapeText(wanted)));
  };
  const bool is_flat = shape.size() == 1;
  constexpr std::int64_t kMaxSize = std::numeric_limits<int>::max();
  if ((!is_flat && shape.size() != 2) || shape[0] > kMaxSize ||
      (!is_flat && shape[1] > kMaxSize)) {
    return fail_shape();
  }
  const int rows = shape[0];
  const int cols = is_flat ? 1 : shape[1];
  // Both sizes fit in 31 bits, so their product does not overflow.
  const size_t size = header.type == "<f8" ? sizeof(double) : sizeof(float);
  const std::uint64_t num_values = static_cast<std::uint64_t>(rows) * cols;
  if (payload.size() % size != 0 || payload.size() / size != num_values) {
    return fail(fmt::format(
        "shape {} of '{}' does not fit the {} bytes after the header "
        "(truncated?)",
        ShapeText(shape),
        header.type,
        payload.size()));
  }
  if (!is_wanted(rows, cols)) {
    return fail_shape();
  }
  *matrix = header.type == "<f8"
                ? ToMatrix<double>(payload, rows, cols, header.is_fortran_order)
                : ToMatrix<float>(payload, rows, cols, header.is_fortran_order);
  return true;
}

}  // namespace

bool WriteNpy(const std::string& path,
              const Eigen::VectorXd& vector,
              std::string* error) {
  return WriteArray(path, {vector.size()}, vector.data(), vector.size(), error);
}

bool WriteNpy(const std::string& path,
              const Eigen::MatrixXd& matrix,
              std::string* error) {
  const Eigen::MatrixXd by_rows = matrix.transpose();
  return WriteArray(path,
                    {matrix.rows(), matrix.cols()},
                    by_rows.data(),
                    by_rows.size(),
                    error);
}

bool ReadNpy(const std::string& path,
             int wanted_rows,
             int wanted_cols,
             Eigen::MatrixXd* matrix,
             std::string* error) {
  CHECK(matrix != nullptr);
  return ReadArray(
      path,
      {wanted_rows, wanted_cols},
      [wanted_rows, wanted_cols](int rows, int cols) {
        return (wanted_rows == -1 || rows == wanted_rows) &&
               (wanted_cols == -1 || cols == wanted_cols);
      },
      matrix,
      error);
}

bool ReadNpy(const std::string& path,
             int wanted_size,
             Eigen::VectorXd* vector,
             std::string* error) {
  CHECK(vector != nullptr);
  Eigen::MatrixXd column;
  if (!ReadArray(
          path,
          {wanted_size},
          [wanted_size](int rows, int cols) {
            return cols == 1 && (wanted_size == -1 || rows == wanted_size);
          },
          &column,
          error)) {
    return false;
  }
  *vector = column;
  return true;
}

bool CheckNpyFinite(const std::string& path,
                    const Eigen::Ref<const Eigen::MatrixXd>& matrix,
                    std::string* error) {
  CHECK(error != nullptr);
  for (int i = 0; i < matrix.rows(); ++i) {
    for (int j = 0; j < matrix.cols(); ++j) {
      const double value = matrix(i, j);
      if (!std::isfinite(value)) {
        *error =
            fmt::format("file {}: {} at row {}, column {} (counted from 0)",
                        path,
                        std::isnan(value) ? "nan" : fmt::format("{}", value),
                        i,
                        j);
        return false;
      }
    }
  }
  return true;
}

}  // namespace invgrad
