#include "invgrad/train/checkpoint.h"

#include <charconv>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <utility>
#include <vector>

#include "glog/logging.h"
#include "invgrad/io/atomic_file.h"

namespace invgrad {
namespace {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
              "doubles are copied to and from little-endian files as they are");

constexpr std::string_view kMagic = "invgrad checkpoint, version ";
constexpr std::string_view kVersion = "1";
constexpr std::string_view kSpace = " \t\r\n\v\f";

// Reads a line, without its end; returns false if there is none.
bool TakeLine(std::string_view* rest, std::string_view* line) {
  const size_t size = rest->find('\n');
  if (size == std::string_view::npos) {
    return false;
  }
  *line = rest->substr(0, size);
  rest->remove_prefix(size + 1);
  return true;
}

bool ParseSize(std::string_view text, std::uint64_t* size) {
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, *size);
  return result.ec == std::errc() && result.ptr == end;
}

// An array in the header whose values are not read yet.
struct Announced {
  Eigen::VectorXd* array = nullptr;
  std::uint64_t size = 0;
};

// Reads the line of one array. Returns an error message, or an empty string.
std::string TakeArray(std::uint64_t num_values_before,
                      std::string_view* rest,
                      Checkpoint* checkpoint,
                      Announced* announced) {
  std::string_view line;
  if (!TakeLine(rest, &line)) {
    return "no line with its name and size (truncated?)";
  }
  const size_t space = line.find(' ');
  std::uint64_t size = 0;
  if (space == 0 || space == std::string_view::npos ||
      !ParseSize(line.substr(space + 1), &size)) {
    return "found '" + std::string(line) + "', wanted name and size";
  }
  const std::string name(line.substr(0, space));
  const auto [entry, is_new] = checkpoint->arrays.try_emplace(name);
  if (!is_new) {
    return "a second '" + name + "'";
  }
  // Compared before the addition, because the sum may overflow.
  const std::uint64_t available = rest->size() / sizeof(double);
  if (size > available || num_values_before + size > available) {
    return "'" + name + "' has " + std::to_string(size) +
           " values, the file is too short for them (truncated?)";
  }
  *announced = {&entry->second, size};
  return "";
}

// Returns an error message, or an empty string.
std::string Parse(std::string_view rest, Checkpoint* checkpoint) {
  std::string_view line;
  if (rest.substr(0, kMagic.size()) != kMagic || !TakeLine(&rest, &line)) {
    return "not a checkpoint (it does not begin with '" + std::string(kMagic) +
           "')";
  }
  const std::string_view version = line.substr(kMagic.size());
  if (version != kVersion) {
    return "found version '" + std::string(version) + "', wanted '" +
           std::string(kVersion) + "'";
  }
  std::uint64_t num_arrays = 0;
  if (!TakeLine(&rest, &line) || !ParseSize(line, &num_arrays)) {
    return "cannot read the number of arrays";
  }

  std::vector<Announced> all;
  std::uint64_t num_values = 0;
  std::string problem;
  while (all.size() < num_arrays && problem.empty()) {
    problem = TakeArray(num_values, &rest, checkpoint, &all.emplace_back());
    num_values += all.back().size;
  }
  if (!problem.empty()) {
    return "array " + std::to_string(all.size()) + " of " +
           std::to_string(num_arrays) + ": " + problem;
  }
  if (rest.size() != num_values * sizeof(double)) {
    return "found " + std::to_string(rest.size()) +
           " bytes of values, wanted " +
           std::to_string(num_values * sizeof(double));
  }

  for (const auto& [array, size] : all) {
    array->resize(size);
    const size_t num_bytes = size * sizeof(double);
    if (num_bytes > 0) {
      std::memcpy(array->data(), rest.data(), num_bytes);
    }
    rest.remove_prefix(num_bytes);
  }
  return "";
}

}  // namespace

bool WriteCheckpoint(const std::string& path,
                     const Checkpoint& checkpoint,
                     std::string* error) {
  std::string bytes(kMagic);
  bytes += kVersion;
  bytes += '\n' + std::to_string(checkpoint.arrays.size()) + '\n';
  for (const auto& [name, array] : checkpoint.arrays) {
    CHECK(!name.empty());
    CHECK(name.find_first_of(kSpace) == std::string::npos)
        << "white space in the name '" << name << "'";
    bytes.append(name).append(" ");
    bytes.append(std::to_string(array.size())).append("\n");
  }
  for (const auto& [name, array] : checkpoint.arrays) {
    if (array.size() > 0) {
      bytes.append(reinterpret_cast<const char*>(array.data()),
                   array.size() * sizeof(double));
    }
  }
  return WriteFile(path, bytes, error);
}

bool ReadCheckpoint(const std::string& path,
                    Checkpoint* checkpoint,
                    std::string* error) {
  CHECK(checkpoint != nullptr);
  std::string bytes;
  if (!ReadFile(path, &bytes, error)) {
    return false;
  }
  Checkpoint read;
  const std::string problem = Parse(bytes, &read);
  if (!problem.empty()) {
    *error = "file " + path + ": " + problem;
    return false;
  }
  *checkpoint = std::move(read);
  return true;
}

}  // namespace invgrad
