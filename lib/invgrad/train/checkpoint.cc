#include "invgrad/train/checkpoint.h"

#include <cstdint>
#include <cstring>
#include <sstream>
#include <string_view>
#include <utility>
#include <vector>

#include "fmt/core.h"
#include "invgrad/internal/logging.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/digest.h"

namespace invgrad {
namespace {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
              "doubles are copied to and from little-endian files as they are");

constexpr char kProgram[] = "invgrad checkpoint, ";
constexpr char kVersion[] = "version 10";

constexpr char kDamaged[] = "the file is truncated or damaged";

// Parses the beginning of a file of `file_size` bytes, up to the values, of the
// sizes *sizes. Returns an error message, or an empty string.
std::string ParseHeader(const std::string& beginning,
                        std::uint64_t file_size,
                        const RunIdentity& identity,
                        std::string* digest,
                        std::vector<std::pair<std::string, size_t>>* sizes,
                        size_t* begin_of_values) {
  std::istringstream header(beginning);
  std::string line, found;
  std::getline(header, line);
  if (line.rfind(kProgram, 0) != 0) return "not a checkpoint";
  if (line != std::string(kProgram) + kVersion) {
    return fmt::format("not of {}, the one of this program", kVersion);
  }
  std::getline(header, *digest);
  while (std::getline(header, line) && !line.empty()) found += line + '\n';
  if (header.fail()) return kDamaged;
  const std::string difference = identity.Difference(found);
  if (!difference.empty()) return "it is of another run: " + difference;
  const size_t max_num_values = file_size / sizeof(double);
  size_t num_arrays = 0, num_values = 0;
  header >> num_arrays;
  for (size_t i = 0; i < num_arrays; ++i) {
    auto& [name, size] = sizes->emplace_back();
    header >> name >> size;
    if (header.fail() || size > max_num_values - num_values) return kDamaged;
    num_values += size;
  }
  if (header.get() != '\n') return kDamaged;
  *begin_of_values = header.tellg();
  return file_size - *begin_of_values == num_values * sizeof(double) ? ""
                                                                     : kDamaged;
}

// Reads the identity and the sizes before the values.
bool ReadArrays(const std::string& path,
                const RunIdentity& identity,
                std::map<std::string, Eigen::VectorXd>* arrays,
                std::string* error) {
  constexpr std::uint64_t kMaxHeader = 1 << 20;
  std::string bytes, digest;
  std::uint64_t file_size = 0;
  std::vector<std::pair<std::string, size_t>> sizes;
  size_t begin = 0;
  if (!ReadBeginning(path, kMaxHeader, &bytes, &file_size, error)) return false;
  std::string problem =
      ParseHeader(bytes, file_size, identity, &digest, &sizes, &begin);
  if (problem.empty()) {
    if (!ReadFile(path, &bytes, error, file_size)) return false;
    const size_t end_of_digest =
        sizeof(kProgram) + sizeof(kVersion) + digest.size();
    if (bytes.size() != file_size ||
        Digest().Add(std::string_view(bytes).substr(end_of_digest)).Hex() !=
            digest) {
      problem = kDamaged;
    }
  }
  const char* values = bytes.data() + begin;
  for (const auto& [name, size] : sizes) {
    if (!problem.empty()) break;
    Eigen::VectorXd array(size);
    if (size > 0) std::memcpy(array.data(), values, size * sizeof(double));
    values += size * sizeof(double);
    if (!arrays->emplace(name, std::move(array)).second) problem = kDamaged;
  }
  if (!problem.empty()) *error = fmt::format("{}: {}", path, problem);
  return problem.empty();
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
  std::string header = fmt::format("{}\n{}\n", identity.text(), arrays_.size());
  for (const auto& [name, array] : arrays_) {
    header += fmt::format("{} {}\n", name, array.size());
  }
  // The arrays may be large: they are not copied.
  std::vector<std::string_view> parts = {"", header};
  for (const auto& [name, array] : arrays_) {
    parts.emplace_back(reinterpret_cast<const char*>(array.data()),
                       array.size() * sizeof(double));
  }
  Digest digest;
  for (const std::string_view part : parts) digest.Add(part);
  const std::string first =
      fmt::format("{}{}\n{}\n", kProgram, kVersion, digest.Hex());
  parts[0] = first;
  return WriteFile(path, parts, error);
}

StateArchive StateArchive::Read(const std::string& path,
                                const RunIdentity& identity) {
  StateArchive archive;
  archive.is_reading_ = true;
  archive.path_ = path;
  ReadArrays(path, identity, &archive.arrays_, &archive.error_);
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
