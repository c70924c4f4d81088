#include "invgrad/npy.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string_view>
#include <vector>

#include "fmt/core.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/core/specification.h"
#include "invgrad/io/atomic_file.h"

namespace invgrad {
namespace {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
              "doubles are copied to and from little-endian files as they are");

constexpr std::string_view kMagic("\x93NUMPY", 6);

struct NpyHeader {
  std::string type;  // with its quotes, such as "'<f8'"
  bool is_fortran_order = false;
  std::vector<std::int64_t> shape;
};

// Removes `key` and its value from a Python dictionary without spaces. Returns
// the value, such as "'<f8'", "False" or "(3,4)"; empty if there is none.
std::string TakeValue(const std::string& key, std::string* dictionary) {
  const std::string start = "'" + key + "':";
  const size_t begin = dictionary->find(start);
  if (begin == std::string::npos) return "";
  const size_t at = begin + start.size();
  // A structured type is a list of fields.
  const char first = (*dictionary)[at];
  const char* const last = first == '\''  ? "'"
                           : first == '[' ? "]"
                           : first == '(' ? ")"
                                          : "e";  // of True and False
  const size_t end = dictionary->find(last, at + 1);
  if (end == std::string::npos) return "";
  std::string value = dictionary->substr(at, end + 1 - at);
  dictionary->erase(begin, end + 1 - begin);
  return value;
}

// "(3,4)", "(3,)" or "()"; Python 2 writes long integers, "(3L,4L)".
bool ParseShape(const std::string& text, std::vector<std::int64_t>* shape) {
  if (text.empty() || text.front() != '(') return false;
  const char* at = text.data() + 1;
  const char* const end = text.data() + text.size() - 1;
  while (at < end) {
    std::int64_t size = 0;
    const auto [next, status] = std::from_chars(at, end, size);
    if (status != std::errc() || size < 0) return false;
    shape->push_back(size);
    at = next;
    if (*at == 'L') ++at;
    if (at < end && *at++ != ',') return false;
  }
  return true;
}

// Parses the Python literal of a header,
//   {'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }
// with the keys in any order.
bool ParseHeader(std::string_view text, NpyHeader* header) {
  std::string rest;
  for (const char c : text) {
    if (c != ' ' && c != '\t' && c != '\n') rest += c == '"' ? '\'' : c;
  }
  header->type = TakeValue("descr", &rest);
  const std::string order = TakeValue("fortran_order", &rest);
  header->is_fortran_order = order == "True";
  return ParseShape(TakeValue("shape", &rest), &header->shape) &&
         !header->type.empty() && (order == "True" || order == "False") &&
         (rest == "{,,}" || rest == "{,,,}");
}

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
                const Eigen::Ref<const Eigen::VectorXd>& values,
                std::string* error) {
  std::string header =
      fmt::format("{{'descr': '<f8', 'fortran_order': False, 'shape': {}, }}",
                  ShapeText(shape));
  // The total size of magic, version, length and header is a multiple of 64
  // bytes.
  constexpr size_t kPreamble = 10;
  constexpr size_t kAlignment = 64;
  const size_t used = (kPreamble + header.size() + 1) % kAlignment;
  header.append((kAlignment - used) % kAlignment, ' ');
  header += '\n';
  const auto size = static_cast<std::uint16_t>(header.size());
  std::string bytes(kMagic);
  bytes.append("\x01\0", 2);
  bytes.append(reinterpret_cast<const char*>(&size), sizeof(size));
  bytes += header;
  bytes.append(reinterpret_cast<const char*>(values.data()),
               values.size() * sizeof(double));
  return WriteFile(path, bytes, error);
}

// Longer than any header of two dimensions.
constexpr size_t kMaxHeaderSize = 1 << 16;

// Parses the header at the beginning of a file. *begin: of the payload. Returns
// an error message, or an empty string.
std::string ParseFile(std::string_view bytes,
                      std::uint64_t file_size,
                      NpyHeader* header,
                      size_t* payload_begin) {
  if (bytes.substr(0, kMagic.size()) != kMagic) {
    return "not a .npy file (it does not begin with \\x93NUMPY)";
  }
  std::string truncated =
      fmt::format("truncated in the header, at {} bytes", file_size);
  if (bytes.size() < 12) return truncated;  // magic, version, longest length
  const int major = static_cast<unsigned char>(bytes[6]);
  const int minor = static_cast<unsigned char>(bytes[7]);
  if (major < 1 || major > 3 || minor != 0) {
    return fmt::format(
        "found .npy version {}.{}, wanted 1.0, 2.0 or 3.0", major, minor);
  }
  const size_t begin = major == 1 ? 10 : 12;
  std::uint32_t size = 0;
  std::memcpy(&size, &bytes[8], begin - 8);
  if (size > file_size - begin) return truncated;
  if (size > bytes.size() - begin) {
    return fmt::format("its header has {} bytes; at most {} are allowed",
                       size,
                       kMaxHeaderSize);
  }
  const std::string_view text = bytes.substr(begin, size);
  if (!ParseHeader(text, header)) {
    constexpr size_t kMaxShown = 120;
    const size_t end = text.find_last_not_of(" \n");
    return "cannot read its header: " +
           Printable(text.substr(0, end + 1), kMaxShown);
  }
  *payload_begin = begin + size;
  return "";
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
  if (!is_fortran_order) values = Columns(values.transpose());
  return values.template cast<double>();
}

}  // namespace

bool WriteNpy(const std::string& path,
              const Eigen::VectorXd& vector,
              std::string* error) {
  return WriteArray(path, {vector.size()}, vector, error);
}

bool WriteNpy(const std::string& path,
              const Eigen::MatrixXd& matrix,
              std::string* error) {
  const Eigen::VectorXd by_rows = matrix.transpose().reshaped();
  return WriteArray(path, {matrix.rows(), matrix.cols()}, by_rows, error);
}

bool ReadNpy(const std::string& path,
             int wanted_rows,
             int wanted_cols,
             Eigen::MatrixXd* matrix,
             std::string* error) {
  std::string bytes;
  std::uint64_t file_size = 0;
  constexpr size_t kPreamble = 12;
  if (!ReadBeginning(
          path, kPreamble + kMaxHeaderSize, &bytes, &file_size, error)) {
    return false;
  }
  const auto fail = [&path, error](const std::string& problem) {
    *error = fmt::format("file {}: {}", path, problem);
    return false;
  };
  NpyHeader header;
  size_t begin = 0;
  const std::string problem = ParseFile(bytes, file_size, &header, &begin);
  if (!problem.empty()) return fail(problem);
  const bool is_double = header.type == "'<f8'";
  if (!is_double && header.type != "'<f4'") {
    return fail(fmt::format(
        "found type {}, wanted '<f8' or '<f4' (in Python: x.astype('<f8'))",
        Printable(header.type)));
  }
  const std::vector<std::int64_t>& shape = header.shape;
  const std::string found = ShapeText(shape);
  constexpr std::int64_t kMaxSize = std::numeric_limits<int>::max();
  const bool has_size = shape.size() == 1 || shape.size() == 2;
  const std::int64_t rows = has_size ? shape[0] : -1;
  const std::int64_t cols = shape.size() == 2 ? shape[1] : 1;
  const auto is_wanted = [](std::int64_t size, int wanted) {
    return size <= kMaxSize && (wanted == -1 || size == wanted);
  };
  if (!has_size || !is_wanted(rows, wanted_rows) ||
      !is_wanted(cols, wanted_cols)) {
    return fail(fmt::format("found shape {}, wanted {}",
                            found,
                            ShapeText({wanted_rows, wanted_cols})));
  }
  // Both sizes fit in 31 bits, so their product does not overflow.
  const size_t size = is_double ? sizeof(double) : sizeof(float);
  const std::uint64_t num_values = static_cast<std::uint64_t>(rows) * cols;
  const std::uint64_t payload_size = file_size - begin;
  if (payload_size % size != 0 || payload_size / size != num_values) {
    return fail(
        fmt::format("shape {} of {} does not fit the {} bytes after the header "
                    "(truncated?)",
                    found,
                    header.type,
                    payload_size));
  }
  if (!FitsInMemory(
          "file " + path + ": it",
          {{"its bytes", 1.0 * file_size},
           {"copies of the array", 3.0 * sizeof(double) * num_values}},
          /*limit=*/0.0,
          error) ||
      !ReadFile(path, &bytes, error, file_size)) {
    return false;
  }
  if (bytes.size() != file_size) return fail("changed while it was read");
  const std::string_view payload = std::string_view(bytes).substr(begin);
  *matrix = is_double
                ? ToMatrix<double>(payload, rows, cols, header.is_fortran_order)
                : ToMatrix<float>(payload, rows, cols, header.is_fortran_order);
  return true;
}

bool ReadNpy(const std::string& path,
             int wanted_size,
             Eigen::VectorXd* vector,
             std::string* error) {
  Eigen::MatrixXd column;
  if (!ReadNpy(path, wanted_size, 1, &column, error)) return false;
  *vector = column;
  return true;
}

}  // namespace invgrad
