#include "problems/estimation/estimation.h"

#include <cstdint>
#include <filesystem>
#include <sstream>

#include "fmt/core.h"
#include "invgrad/io/atomic_file.h"
#include "problems/estimation/text_cursor.h"

namespace invgrad {
namespace {

struct Kind {
  std::string name;
  std::vector<std::string> extensions;
  EstimationReader* read;
  // Of a file that begins so; it may be damaged.
  bool (*recognizes)(const std::string& beginning);
};

bool IsNist(const std::string& beginning) {
  return beginning.find("Dataset Name:") != std::string::npos;
}

// Text.
bool IsTable(const std::string& beginning) {
  return !beginning.empty() && beginning.find('\0') == std::string::npos;
}

// Three counts, or bzip2.
bool IsBal(const std::string& beginning) {
  std::istringstream words(beginning);
  long count = 0;
  return beginning.rfind("BZh", 0) == 0 || words >> count >> count >> count;
}

// The first line that is no comment has a tag.
bool IsG2o(const std::string& beginning) {
  std::istringstream lines(beginning);
  std::string word;
  while (lines >> word && word[0] == '#') std::getline(lines, word);
  return word == "FIX" || word.rfind("VERTEX_", 0) == 0 ||
         word.rfind("EDGE_", 0) == 0 || word.rfind("PARAMS_", 0) == 0;
}

const std::vector<Kind>& Kinds() {
  static const auto& kinds = *new std::vector<Kind>{
      {"nist", {".dat"}, ReadNistEstimation, IsNist},
      {"csv", {".csv", ".tsv"}, ReadFormulaEstimation, IsTable},
      {"bal", {".txt", ".txt.bz2"}, ReadBalEstimation, IsBal},
      {"g2o", {".g2o"}, ReadPoseGraphEstimation, IsG2o},
  };
  return kinds;
}

}  // namespace

std::vector<std::string> EstimationKinds() {
  std::vector<std::string> names;
  for (const Kind& kind : Kinds()) names.push_back(kind.name);
  return names;
}

std::string EstimationKindOf(const std::string& path) {
  for (const Kind& kind : Kinds()) {
    for (const std::string& end : kind.extensions) {
      if (EndsWith(path, end)) return kind.name;
    }
  }
  return "";
}

bool IsEstimationFile(const std::string& path, const std::string& kind) {
  const std::string wanted = kind.empty() ? EstimationKindOf(path) : kind;
  constexpr int kSize = 4096;
  std::string beginning, ignored;
  std::uint64_t file_size = 0;
  const bool is_read =
      ReadBeginning(path, kSize, &beginning, &file_size, &ignored);
  for (const Kind& row : Kinds()) {
    if (row.name == wanted) {
      return !is_read ||
             row.recognizes(std::string(WithoutByteOrderMark(beginning)));
    }
  }
  return false;
}

std::unique_ptr<Estimation> ReadEstimation(const std::string& path,
                                           const ReadEstimationOptions& options,
                                           std::string* error) {
  const std::string kind =
      options.kind.empty() ? EstimationKindOf(path) : options.kind;
  // Small files go to the reader, whose messages name the line.
  constexpr std::uint64_t kLarge = 1 << 26;
  std::error_code failure;
  if (!kind.empty() && std::filesystem::file_size(path, failure) >= kLarge &&
      !failure && !IsEstimationFile(path, kind)) {
    *error = fmt::format(
        "{}: it does not begin as a file of its kind, and is not read", path);
    return nullptr;
  }
  std::string known;
  for (const Kind& row : Kinds()) {
    if (row.name == kind) return row.read(path, options, error);
    for (const std::string& end : row.extensions) {
      known +=
          fmt::format("{}{} ({})", known.empty() ? "" : ", ", end, row.name);
    }
  }
  *error = fmt::format(
      "{}: unknown kind of file; expected a name that ends in {}, or a format",
      path,
      known);
  return nullptr;
}

}  // namespace invgrad
