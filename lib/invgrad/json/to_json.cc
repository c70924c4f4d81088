#include "invgrad/to_json.h"

#include <optional>
#include <vector>

#include "ceres/types.h"
#include "nlohmann/json.hpp"

namespace invgrad {
namespace {

using Json = nlohmann::ordered_json;

Json Array(const Eigen::VectorXd& vector) {
  return std::vector<double>(vector.data(), vector.data() + vector.size());
}

Json Rows(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    rows.push_back(Array(matrix.row(i)));
  }
  return rows;
}

template <typename T>
Json Optional(const std::optional<T>& value) {
  return value ? Json(*value) : Json();
}

const char* Name(DomainFailure::Reason reason) {
  switch (reason) {
    case DomainFailure::Reason::kPlus:
      return "plus";
    case DomainFailure::Reason::kReturned:
      return "returned";
    case DomainFailure::Reason::kResidual:
      return "residual";
    case DomainFailure::Reason::kCost:
      return "cost";
    case DomainFailure::Reason::kJacobian:
      break;
  }
  return "jacobian";
}

}  // namespace

static void to_json(Json& json, const RankReport::Block& block) {
  json = {{"name", block.name},
          {"size", block.size},
          {"tangent_size", block.tangent_size},
          {"column", block.column},
          {"group", block.group},
          {"components", block.components}};
}

static void to_json(Json& json, const RankReport::Unused& unused) {
  json = {{"block", unused.block},
          {"whole_block", unused.whole_block},
          {"in_no_residual", unused.in_no_residual},
          {"has_rounding", unused.has_rounding},
          {"tangent", unused.tangent}};
}

static void to_json(Json& json, const RankReport::Part& part) {
  json = {{"block", part.block},
          {"share", part.share},
          {"motion", Array(part.motion)}};
}

static void to_json(Json& json, const RankReport::Direction& direction) {
  json = {{"singular_value", direction.singular_value},
          {"parts", direction.parts},
          {"group", direction.group},
          {"gauge", direction.gauge},
          {"generator", direction.generator}};
}

static void to_json(Json& json, const RankReport::GaugeFreedom& gauge) {
  json = {{"group", gauge.group},
          {"name", gauge.name},
          {"num_generators", gauge.num_generators},
          {"directions", gauge.directions}};
}

static void to_json(Json& json, const RankReport::ShortColumn& column) {
  json = {{"block", column.block},
          {"tangent", column.tangent},
          {"relative_length", column.relative_length}};
}

static void to_json(Json& json, const RankReport::EqualParameters& equal) {
  json = {{"blocks", equal.blocks},
          {"tangents", equal.tangents},
          {"value", equal.value}};
}

static void to_json(Json& json, const RankReport::Suggestion& suggestion) {
  json = {{"group", suggestion.group},
          {"block", suggestion.block},
          {"whole_block", suggestion.whole_block},
          {"tangent", suggestion.tangent},
          {"num_removed", suggestion.num_removed}};
}

static void to_json(Json& json, const Covariance::Block& block) {
  json = block.block;
  json["values"] = Array(block.values);
  json["undetermined_shares"] = Array(block.undetermined_shares);
  json["standard_deviations"] = Array(block.standard_deviations);
  json["weak_variances"] = Array(block.weak_variances);
  json["omitted_variances"] = Array(block.omitted_variances);
  json["rounding"] = block.rounding;
  json["at_bound"] = block.at_bound;
}

static void to_json(Json& json, const DomainFailure::Parameter& parameter) {
  json = {{"block", parameter.block},
          {"name", parameter.name},
          {"component", parameter.component},
          {"value", parameter.value},
          {"was", parameter.was}};
}

void to_json(Json& json, const RankReport& report) {
  json = {{"schema", JsonSchema("rank_report")},
          {"cost", report.cost},
          {"num_residuals", report.num_residuals},
          {"num_parameters", report.num_parameters},
          {"num_constant_blocks", report.num_constant_blocks},
          {"num_groups", report.num_groups},
          {"rank", report.rank},
          {"is_complete", report.is_complete},
          {"s_max", report.s_max},
          {"threshold", report.threshold},
          {"weak_threshold", report.weak_threshold},
          {"singular_values", Array(report.singular_values)},
          {"has_all_singular_values", report.has_all_singular_values},
          {"unscaled_singular_values", Array(report.unscaled_singular_values)},
          {"shortest_column", report.shortest_column},
          {"longest_column", report.longest_column},
          {"blocks", report.blocks},
          {"unused", report.unused},
          {"short_columns", report.short_columns},
          {"undetermined", report.undetermined},
          {"weak", report.weak},
          {"equal_parameters", report.equal_parameters},
          {"gauges", report.gauges},
          {"suggestions", report.suggestions}};
}

void to_json(Json& json, const Covariance& covariance) {
  json = {{"schema", JsonSchema("covariance")},
          {"cost", covariance.cost()},
          {"num_residuals", covariance.num_residuals()},
          {"num_parameters", covariance.num_parameters()},
          {"rank", covariance.rank()},
          {"uses_residual_variance", covariance.uses_residual_variance()},
          {"residual_variance", covariance.residual_variance()},
          {"blocks", covariance.blocks()}};
  Json& pairs = json["pairs"] = Json::array();
  for (const auto& [pair, C] : covariance.tangent_blocks()) {
    pairs.push_back({{"block_a", pair.first},
                     {"block_b", pair.second},
                     {"tangent_block", Rows(C)}});
  }
}

void to_json(Json& json, const DomainFailure& failure) {
  json = {{"schema", JsonSchema("domain_failure")},
          {"reason", Name(failure.reason)},
          {"residual_block", failure.residual_block},
          {"num_failing_blocks", failure.num_failing_blocks},
          {"fails_at_good_state", failure.fails_at_good_state},
          {"only_without_jacobians", failure.only_without_jacobians},
          {"is_start", failure.is_start},
          {"parameters", failure.parameters}};
}

void to_json(Json& json, const UpdateCallback::Summary& summary) {
  json = {{"schema", JsonSchema("proposals")},
          {"num_proposed", summary.num_proposed},
          {"num_accepted", summary.num_accepted},
          {"num_rejected", summary.num_rejected},
          {"num_withheld", summary.num_withheld},
          {"num_ceres_steps", summary.num_ceres_steps},
          {"num_outside_domain", summary.num_outside_domain},
          {"first_outside_domain", Optional(summary.first_outside_domain)},
          {"message", summary.message},
          {"ended_on_proposal", summary.ended_on_proposal},
          {"has_converged", summary.has_converged},
          {"num_plain_iterations", summary.num_plain_iterations},
          {"num_limited_steps", summary.num_limited_steps},
          {"took_plain_result", summary.took_plain_result},
          {"predicted_decrease", summary.predicted_decrease}};
}

void to_json(Json& json, const MinimizerSummary& summary) {
  json = {{"schema", JsonSchema("minimizer")},
          {"termination_type",
           ceres::TerminationTypeToString(summary.termination_type)},
          {"message", summary.message},
          {"initial_cost", summary.initial_cost},
          {"final_cost", summary.final_cost},
          {"num_steps", summary.num_steps()},
          {"total_time_in_seconds", summary.total_time_in_seconds},
          {"num_undone", summary.num_undone},
          {"num_outside_domain", summary.num_outside_domain},
          {"first_outside_domain", Optional(summary.first_outside_domain)},
          {"proposals", Optional(summary.proposals)}};
}

Json JsonSchema(const std::string& name) {
  return {{"name", "invgrad." + name}, {"version", 1}};
}

std::string JsonText(const Json& json) {
  return json.dump(/*indent=*/-1,
                   ' ',
                   /*ensure_ascii=*/false,
                   Json::error_handler_t::replace) +
         "\n";
}

}  // namespace invgrad
