#include "invgrad/io/checkpoint.h"

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

// Takes a line without its end; false if there is none.
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

// Returns what is wrong, or nothing.
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

  std::vector<Eigen::VectorXd*> arrays;
  std::vector<std::uint64_t> sizes;
  std::uint64_t num_values = 0;
  for (std::uint64_t i = 0; i < num_arrays; ++i) {
    const std::string where = "array " + std::to_string(i + 1) + " of " +
                              std::to_string(num_arrays) + ": ";
    if (!TakeLine(&rest, &line)) {
      return where + "no line with its name and size (truncated?)";
    }
    const size_t space = line.find(' ');
    std::uint64_t size = 0;
    if (space == 0 || space == std::string_view::npos ||
        !ParseSize(line.substr(space + 1), &size)) {
      return where + "found '" + std::string(line) + "', wanted name and size";
    }
    const std::string name(line.substr(0, space));
    const auto [array, is_new] = checkpoint->arrays.try_emplace(name);
    if (!is_new) {
      return where + "a second '" + name + "'";
    }
    // Compared before it is added: the sum must not overflow.
    if (size > rest.size() / sizeof(double) ||
        num_values + size > rest.size() / sizeof(double)) {
      return where + "'" + name + "' has " + std::to_string(size) +
             " values, the file is too short for them (truncated?)";
    }
    num_values += size;
    arrays.push_back(&array->second);
    sizes.push_back(size);
  }
  if (rest.size() != num_values * sizeof(double)) {
    return "found " + std::to_string(rest.size()) +
           " bytes of values, wanted " +
           std::to_string(num_values * sizeof(double));
  }

  for (size_t i = 0; i < arrays.size(); ++i) {
    arrays[i]->resize(sizes[i]);
    const size_t num_bytes = sizes[i] * sizeof(double);
    if (num_bytes > 0) {
      std::memcpy(arrays[i]->data(), rest.data(), num_bytes);
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
    bytes += name + ' ' + std::to_string(array.size()) + '\n';
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
