#include "problems/estimation/estimation.h"

#include <algorithm>

#include "fmt/core.h"
#include "problems/estimation/bal_estimation.h"
#include "problems/estimation/nist_estimation.h"
#include "problems/estimation/pose_graph_estimation.h"

namespace invgrad {

namespace {

struct Kind {
  std::string name;
  std::vector<std::string> extensions;
  std::unique_ptr<Estimation> (*read)(const std::string& path,
                                      const ReadEstimationOptions& options,
                                      std::string* error);
};

std::unique_ptr<Estimation> ReadNist(const std::string& path,
                                     const ReadEstimationOptions& /*options*/,
                                     std::string* error) {
  return ReadNistEstimation(path, error);
}

std::unique_ptr<Estimation> ReadBal(const std::string& path,
                                    const ReadEstimationOptions& /*options*/,
                                    std::string* error) {
  return ReadBalEstimation(path, error);
}

std::unique_ptr<Estimation> ReadG2o(const std::string& path,
                                    const ReadEstimationOptions& options,
                                    std::string* error) {
  return ReadPoseGraphEstimation(path, options.information_root, error);
}

const std::vector<Kind>& Kinds() {
  static const auto* const kinds = new std::vector<Kind>{
      {"nist", {".dat"}, ReadNist},
      {"bal", {".txt", ".txt.bz2"}, ReadBal},
      {"g2o", {".g2o"}, ReadG2o},
  };
  return *kinds;
}

bool EndsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() &&
         text.compare(text.size() - end.size(), end.size(), end) == 0;
}

bool IsOf(const Kind& kind, const std::string& path) {
  return std::any_of(
      kind.extensions.begin(),
      kind.extensions.end(),
      [&path](const std::string& end) { return EndsWith(path, end); });
}

}  // namespace

const std::vector<std::string>& EstimationKinds() {
  static const auto* const names = [] {
    auto* all = new std::vector<std::string>;
    for (const Kind& kind : Kinds()) all->push_back(kind.name);
    return all;
  }();
  return *names;
}

std::string EstimationKindOf(const std::string& path) {
  for (const Kind& kind : Kinds()) {
    if (IsOf(kind, path)) return kind.name;
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
