#include "invgrad/train/checkpoint.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <utility>
#include <vector>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/digest.h"

namespace invgrad {
namespace {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
              "doubles are copied to and from little-endian files as they are");

constexpr char kProgram[] = "invgrad checkpoint, ";
constexpr char kVersion[] = "version 2";

constexpr char kDamaged[] = "the file is truncated or damaged";

std::string_view Bytes(const Eigen::VectorXd& values) {
  return {reinterpret_cast<const char*>(values.data()),
          values.size() * sizeof(double)};
}

// Reads the next `size` bytes, or fewer at the end.
std::string Read(size_t size, std::istream* file) {
  std::string bytes(size, '\0');
  file->read(bytes.data(), static_cast<std::streamsize>(size));
  bytes.resize(file->gcount());
  return bytes;
}

// Reads a line that a checkpoint may have; false for a longer one.
bool ReadLine(std::istream* file, std::string* line) {
  constexpr int kMaxLength = 1 << 16;
  std::vector<char> text(kMaxLength);
  file->getline(text.data(), kMaxLength);
  *line = text.data();
  return file->good();
}

// Reads the file at its second line, the digest. Returns an error message, or an
// empty string. What is read at any time is bounded by the file's own sizes.
std::string Parse(std::uintmax_t file_size,
                  const RunIdentity& identity,
                  std::istream* file,
                  std::map<std::string, Eigen::VectorXd>* arrays) {
  std::string digest, found, line;
  if (!ReadLine(file, &digest)) return kDamaged;
  const std::streamoff begin = file->tellg();
  while (ReadLine(file, &line) && !line.empty()) found += line + '\n';
  if (!file->good()) return kDamaged;
  const std::string difference = identity.Difference(found);
  if (!difference.empty()) return "it is of another run: " + difference;
  size_t num_arrays = 0, num_values = 0;
  *file >> num_arrays;
  std::vector<std::pair<std::string, size_t>> sizes;
  for (size_t i = 0; i < num_arrays; ++i) {
    auto& [name, size] = sizes.emplace_back();
    constexpr int kMaxLength = 1000;
    *file >> std::setw(kMaxLength) >> name >> size;
    if (file->fail() || size > file_size / sizeof(double) - num_values) {
      return kDamaged;
    }
    num_values += size;
  }
  if (file->get() != '\n') return kDamaged;
  const std::streamoff begin_of_values = file->tellg();
  if (file_size - begin_of_values != num_values * sizeof(double)) {
    return kDamaged;
  }
  file->seekg(begin);
  Digest sum;
  sum.Add(Read(begin_of_values - begin, file));
  for (const auto& [name, size] : sizes) {
    Eigen::VectorXd array(size);
    file->read(reinterpret_cast<char*>(array.data()),
               static_cast<std::streamsize>(size * sizeof(double)));
    sum.Add(Bytes(array));
    if (!arrays->emplace(name, std::move(array)).second) return kDamaged;
  }
  return file->good() && sum.Hex() == digest ? "" : kDamaged;
}

}  // namespace

bool AreCounts(const Eigen::VectorXd& values, double max) {
  return (values.array() >= 0.0 && values.array() <= max &&
          values.array() == values.array().floor())
      .all();
}

bool StateArchive::Write(const std::string& path,
                         const RunIdentity& identity,
                         std::string* error) const {
  std::string bytes = fmt::format("{}\n{}\n", identity.text(), arrays_.size());
  for (const auto& [name, array] : arrays_) {
    bytes += fmt::format("{} {}\n", name, array.size());
  }
  for (const auto& [name, array] : arrays_) bytes += Bytes(array);
  bytes.insert(
      0,
      fmt::format("{}{}\n{}\n", kProgram, kVersion, Digest().Add(bytes).Hex()));
  return WriteFile(path, bytes, error);
}

StateArchive StateArchive::Read(const std::string& path,
                                const RunIdentity& identity) {
  StateArchive archive;
  archive.is_reading_ = true;
  archive.path_ = path;
  std::error_code failure;
  // Opening a pipe would wait for its writer.
  if (!std::filesystem::is_regular_file(path, failure)) {
    archive.error_ =
        fmt::format("cannot read {}: {}",
                    path,
                    failure ? failure.message() : "not a regular file");
    return archive;
  }
  std::ifstream file(path, std::ios::binary);
  const std::string program = kProgram, version = kVersion;
  if (invgrad::Read(program.size(), &file) != program) {
    archive.Fail("not a checkpoint");
  } else if (invgrad::Read(version.size() + 1, &file) != version + '\n') {
    archive.Fail(fmt::format("not of {}, the one of this program", version));
  } else {
    const std::string problem = Parse(std::filesystem::file_size(path, failure),
                                      identity,
                                      &file,
                                      &archive.arrays_);
    if (!problem.empty()) archive.Fail(problem);
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

void StateArchive::Visit(const std::string& name, double* value) {
  Eigen::VectorXd array = Eigen::VectorXd::Constant(1, *value);
  Visit(name, &array, 1);
  *value = array[0];
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
