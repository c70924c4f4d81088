#include "bin/estimate/run_report.h"

#include "fmt/core.h"
#include "invgrad/to_json.h"
#include "nlohmann/json.hpp"

namespace invgrad {

std::string RunReport::ToJson() const {
  nlohmann::ordered_json json = {{"schema", JsonSchema("estimate")},
                                 {"start", start},
                                 {"method", method},
                                 {"status", status},
                                 {"minimizer", minimizer},
                                 {"rank_report", nullptr},
                                 {"covariance", nullptr}};
  if (rank) json["rank_report"] = *rank;
  if (covariance) json["covariance"] = *covariance;
  return JsonText(json);
}

std::string RunReport::ToText() const {
  std::string text = fmt::format(
      "{}, {}\n  {}\n  {}\n", start, method, status, minimizer.BriefReport());
  if (covariance) text += "\nCovariance\n" + covariance->ToText();
  if (rank) text += "\nRank\n" + rank->ToText();
  return text;
}

bool AddCovariance(const Estimation& estimation,
                   const ceres::Problem& problem,
                   RunReport* report,
                   std::string* error) {
  Covariance::Options options;
  options.rank.block_name = [&estimation](const double* values) {
    return estimation.BlockName(values);
  };
  options.use_residual_variance = !estimation.traits().has_unit_variance;
  Covariance covariance;
  RankReport rank;
  if (!ComputeCovariance(options,
                         problem,
                         estimation.CovariancePairs(problem),
                         &covariance,
                         error) ||
      !ComputeRankReport(options.rank, problem, &rank, error)) {
    return false;
  }
  report->covariance = covariance;
  report->rank = rank;
  return true;
}

}  // namespace invgrad
