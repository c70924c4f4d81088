#include "problems/estimation/estimation.h"

#include "fmt/core.h"

namespace invgrad {

namespace {

struct Kind {
  std::string name;
  std::vector<std::string> extensions;
  EstimationReader* read;
};

const std::vector<Kind>& Kinds() {
  static const auto& kinds = *new std::vector<Kind>{
      {"nist", {".dat"}, ReadNistEstimation},
      {"bal", {".txt", ".txt.bz2"}, ReadBalEstimation},
      {"g2o", {".g2o"}, ReadPoseGraphEstimation},
  };
  return kinds;
}

bool EndsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() &&
         text.compare(text.size() - end.size(), end.size(), end) == 0;
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

std::unique_ptr<Estimation> ReadEstimation(const std::string& path,
                                           const ReadEstimationOptions& options,
                                           std::string* error) {
  const std::string kind =
      options.kind.empty() ? EstimationKindOf(path) : options.kind;
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
