#include "invgrad/train/checkpoint.h"

#include <cstring>
#include <sstream>
#include <utility>
#include <vector>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/io/atomic_file.h"

namespace invgrad {
namespace {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
              "doubles are copied to and from little-endian files as they are");

constexpr char kFirstLine[] = "invgrad checkpoint, version 1";

// Splits a file into its arrays; returns false if it is damaged.
bool Parse(const std::string& bytes,
           std::map<std::string, Eigen::VectorXd>* arrays) {
  std::istringstream header(bytes);
  std::string line;
  std::getline(header, line);
  size_t num_arrays = 0;
  header >> num_arrays;
  const size_t max_num_values = bytes.size() / sizeof(double);
  size_t num_values = 0;
  std::vector<std::pair<std::string, size_t>> sizes;
  for (size_t i = 0; i < num_arrays; ++i) {
    auto& [name, size] = sizes.emplace_back();
    header >> name >> size;
    if (header.fail() || size > max_num_values - num_values) return false;
    num_values += size;
  }
  if (header.get() != '\n') return false;
  const size_t begin = header.tellg();
  if (bytes.size() - begin != num_values * sizeof(double)) return false;
  const char* values = bytes.data() + begin;
  for (const auto& [name, size] : sizes) {
    Eigen::VectorXd array(size);
    if (size > 0) std::memcpy(array.data(), values, size * sizeof(double));
    values += size * sizeof(double);
    if (!arrays->emplace(name, std::move(array)).second) return false;
  }
  return true;
}

}  // namespace

bool StateArchive::Write(const std::string& path, std::string* error) const {
  std::string bytes = fmt::format("{}\n{}\n", kFirstLine, arrays_.size());
  for (const auto& [name, array] : arrays_) {
    bytes += fmt::format("{} {}\n", name, array.size());
  }
  for (const auto& [name, array] : arrays_) {
    bytes.append(reinterpret_cast<const char*>(array.data()),
                 array.size() * sizeof(double));
  }
  return WriteFile(path, bytes, error);
}

StateArchive StateArchive::Read(const std::string& path) {
  StateArchive archive;
  archive.is_reading_ = true;
  archive.path_ = path;
  std::string bytes;
  if (!ReadFile(path, &bytes, &archive.error_)) return archive;
  if (bytes.rfind(kFirstLine + std::string("\n"), 0) != 0) {
    archive.Fail(fmt::format("the first line is not '{}'", kFirstLine));
  } else if (!Parse(bytes, &archive.arrays_)) {
    archive.Fail("the file is truncated or damaged");
  }
  return archive;
}

void StateArchive::Visit(const std::string& name,
                         Eigen::VectorXd* values,
                         Eigen::Index size) {
  if (!is_reading()) {
    CHECK(arrays_.emplace(prefix_ + name, *values).second)
        << name << " is visited twice";
    return;
  }
  const auto found = arrays_.find(prefix_ + name);
  Require(found != arrays_.end() && (size < 0 || found->second.size() == size),
          name);
  if (error_.empty()) *values = found->second;
}

void StateArchive::Expect(const std::string& name, long value) {
  long found = value;
  Visit(name, &found);
  if (found != value) {
    Fail(fmt::format("found {}={}, wanted {}", name, found, value));
  }
}

void StateArchive::Require(bool fits, const std::string& name) {
  if (fits || !is_reading()) return;
  Fail(fmt::format("array '{}' is missing or does not fit this run",
                   prefix_ + name));
}

void StateArchive::Fail(const std::string& problem) {
  if (error_.empty()) error_ = fmt::format("{}: {}", path_, problem);
}

}  // namespace invgrad
