#include "invgrad/to_json.h"

#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "ceres/problem.h"
#include "gtest/gtest.h"
#include "invgrad/fit.h"
#include "nlohmann/json.hpp"
#include "tests/rank/rank_problems.h"
#include "tests/support/json_page.h"

namespace invgrad {
namespace json_test {

using nlohmann::ordered_json;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// As another program reads it.
template <typename Report>
nlohmann::json Read(const Report& report) {
  return nlohmann::json::parse(JsonText(ordered_json(report)));
}

RankReport::Direction SomeDirection() {
  RankReport::Direction direction;
  direction.parts.push_back({0, 1.0, Eigen::Vector2d(1.0, -0.5)});
  return direction;
}

// Every list has an element.
RankReport FullRankReport() {
  RankReport report;
  report.singular_values = report.unscaled_singular_values =
      Eigen::Vector2d(0.0, 1.0);
  RankReport::Block block;
  block.name = "b";
  block.components = {0, -1};
  report.blocks.push_back(block);
  report.unused.push_back({0, true, false, false, {1}});
  report.undetermined.push_back(SomeDirection());
  report.weak.push_back(SomeDirection());
  report.short_columns.push_back({0, 1, 0.01});
  report.equal_parameters.push_back({{0, 0}, {0, 1}, 2.5});
  report.gauges.push_back({0, "plane", 3, {0}});
  report.suggestions.push_back({0, 0, true, {0}, 1});
  return report;
}

DomainFailure SomeDomainFailure() {
  DomainFailure failure;
  failure.parameters.push_back({2, "gain", 1, -0.5, 3.0});
  return failure;
}

UpdateCallback::Summary FullProposals() {
  UpdateCallback::Summary summary;
  summary.first_outside_domain = SomeDomainFailure();
  return summary;
}

MinimizerSummary FullMinimizer() {
  MinimizerSummary summary;
  summary.first_outside_domain = SomeDomainFailure();
  summary.proposals = FullProposals();
  return summary;
}

// x0 + x1 is measured twice; y has a prior of standard deviation 1/2, and z is
// in no residual.
class Sums {
 public:
  Sums() {
    problem_.AddResidualBlock(
        new Linear({Row({1.0, 1.0}), Row({0.0})}), nullptr, x_, y_);
    problem_.AddResidualBlock(
        new Linear({Row({1.0, 1.0}), Row({0.0})}), nullptr, x_, y_);
    AddPrior(Row({2.0}), y_, &problem_);
    problem_.AddParameterBlock(z_, 1);
  }

  void BoundZ() { problem_.SetParameterLowerBound(z_, 0, z_[0]); }

  RankReport::Options RankOptions() const {
    RankReport::Options options;
    options.block_name = [this](const double* values) {
      return values == x_ ? "x" : values == y_ ? "y\"\n\xff" : "z";
    };
    return options;
  }

  Covariance ComputeCovariance() const {
    Covariance::Options options;
    options.rank.block_name = RankOptions().block_name;
    Covariance covariance;
    std::string error;
    EXPECT_TRUE(invgrad::ComputeCovariance(
        options, problem_, AllPairs({x_, y_, z_}), &covariance, &error))
        << error;
    return covariance;
  }

  const ceres::Problem& problem() const { return problem_; }

 private:
  double x_[2] = {0.1, 0.7};
  double y_[1] = {1.0 / 3.0};
  double z_[1] = {-4.0};
  ceres::Problem problem_;
};

TEST(ToJson, TheRankReportIsThatOfThePage) {
  std::set<std::string> found;
  ExpectOnPage(Read(FullRankReport()), &found);
  ExpectAllFound("invgrad.rank_report", found);
}

// Of a line, behind a parameter whose derivatives are rounding errors.
Covariance LineCovariance() {
  double x[3] = {0.0, 1.0, 2.0};
  ceres::Problem problem;
  for (int i = 0; i < 5; ++i) {
    AddPrior(Row({1e-16 * (1 + i % 2), 1.0, 1.0 * i}), x, &problem);
  }
  Covariance covariance;
  std::string error;
  EXPECT_TRUE(ComputeCovariance(
      {}, problem, MarginalPairs(problem), &covariance, &error))
      << error;
  return covariance;
}

TEST(ToJson, TheCovarianceIsThatOfThePage) {
  std::set<std::string> found;
  const nlohmann::json line = Read(LineCovariance());
  EXPECT_EQ(line["blocks"][0]["rounding"], std::vector<int>({0}));
  ExpectOnPage(line, &found);
  Sums sums;
  ExpectOnPage(Read(sums.ComputeCovariance()), &found);
  sums.BoundZ();
  ExpectOnPage(Read(sums.ComputeCovariance()), &found);
  ExpectAllFound("invgrad.covariance", found);
}

TEST(ToJson, TheMinimizerIsThatOfThePage) {
  std::set<std::string> found;
  ExpectOnPage(Read(FullMinimizer()), &found);
  ExpectAllFound("invgrad.minimizer", found);
  ExpectAllFound("invgrad.proposals", found);
  ExpectAllFound("invgrad.domain_failure", found);
  // What is missing is null.
  const nlohmann::json json = Read(MinimizerSummary());
  EXPECT_TRUE(json.at("proposals").is_null());
  EXPECT_TRUE(json.at("first_outside_domain").is_null());
  ExpectOnPage(json, &found);
}

// Of x0 + x1 alone, measured twice: 1 and 2.
struct Sum {
  template <typename T>
  bool operator()(int /*data_set*/, int i, const T* x, T* residual) const {
    *residual = x[0] + x[1] - 1.0 * (i + 1);
    return true;
  }
};

TEST(ToJson, AFitIsThatOfThePage) {
  std::vector<FitResult<2>> fits(2);
  FitMany(FitOptions(), Sum(), {2, 0}, &fits);
  const nlohmann::json json = Read(fits);
  ASSERT_EQ(json.size(), 2u);
  std::set<std::string> found;
  ExpectOnPage(json[0], &found);
  ExpectOnPage(json[1], &found);
  ExpectAllFound("invgrad.fit", found);
  EXPECT_TRUE(json[0]["is_converged"]);
  EXPECT_EQ(json[0]["rank"], 1);
  EXPECT_EQ(json[0]["x"][0].get<double>(), fits[0].x[0]);
  EXPECT_NEAR(json[0]["x"][0], 0.75, 1e-3);
  EXPECT_EQ(json[0]["covariance"][0][1].get<double>(),
            fits[0].covariance(0, 1));
  EXPECT_TRUE(json[0]["standard_errors"][1].is_null());  // infinite
  EXPECT_NEAR(json[0]["undetermined_shares"][1], 0.5, 1e-12);
}

// r = log(x - i)
struct Logarithm {
  template <typename T>
  bool operator()(int /*data_set*/, int i, const T* x, T* residual) const {
    using std::log;
    *residual = log(x[0] - 1.0 * i);
    return true;
  }
};

TEST(ToJson, AFitsStatusIsThatOfItsRemarks) {
  std::vector<FitResult<1>> fits(2);
  fits[0].x << 0.5;
  fits[1].x << 2.0;
  FitMany(FitOptions(), Logarithm(), {1, 3}, &fits);
  fits[0].predicted_decrease = 0.03;  // far from a minimum
  fits[0].equal_parameter = 0;
  fits[0].equal_to = 0;
  const nlohmann::json json = Read(fits);
  EXPECT_FALSE(json[0]["is_converged"]);
  EXPECT_EQ(json[0]["status"], fits[0].StatusText());
  EXPECT_EQ(json[0]["predicted_decrease"], 0.03);
  EXPECT_EQ(json[0]["invalid_row"], -1);
  EXPECT_EQ(json[0]["equal_parameter"], 0);
  EXPECT_EQ(json[0]["equal_to"], 0);
  // The start of the second one has no value in row 2.
  EXPECT_EQ(json[1]["status"], fits[1].StatusText());
  EXPECT_EQ(json[1]["invalid_row"], 2);
  EXPECT_EQ(json[1]["invalid_parameter"], 0);
  EXPECT_EQ(json[1]["valid_value"].get<double>(), fits[1].valid_value);
}

TEST(ToJson, HasTheValuesOfTheRankReport) {
  const Sums sums;
  const RankReport report = Report(sums.problem(), sums.RankOptions());
  const nlohmann::json json = Read(report);
  EXPECT_EQ(json["rank"], 2);
  EXPECT_EQ(json["num_parameters"], 4);
  EXPECT_EQ(json["blocks"][0]["name"], "x");
  EXPECT_EQ(json["blocks"][0]["components"], std::vector<int>({0, 1}));
  ASSERT_EQ(json["undetermined"].size(), 1u);
  const nlohmann::json& part = json["undetermined"][0]["parts"][0];
  EXPECT_EQ(part["block"], 0);
  EXPECT_EQ(part["motion"][0].get<double>(),
            report.undetermined[0].parts[0].motion[0]);
  ASSERT_EQ(json["unused"].size(), 1u);
  EXPECT_EQ(json["blocks"][json["unused"][0]["block"].get<int>()]["name"], "z");
}

TEST(ToJson, HasTheValuesOfTheCovarianceBitForBit) {
  const Covariance covariance = Sums().ComputeCovariance();
  const nlohmann::json json = Read(covariance);
  ASSERT_EQ(json["blocks"].size(), 3u);
  EXPECT_EQ(json["blocks"][1]["values"][0].get<double>(), 1.0 / 3.0);
  EXPECT_EQ(json["blocks"][1]["standard_deviations"][0].get<double>(),
            covariance.blocks()[1].standard_deviations[0]);
  EXPECT_NEAR(json["blocks"][1]["standard_deviations"][0], 0.5, 1e-15);
  // (x0 + x1) has the variance 1/2; of least norm, each of them a quarter of it.
  EXPECT_NEAR(json["blocks"][0]["standard_deviations"][0].get<double>(),
              std::sqrt(1.0 / 8.0),
              1e-15);
  EXPECT_NEAR(json["blocks"][0]["undetermined_shares"][0], 0.5, 1e-15);
  // Infinite.
  EXPECT_TRUE(json["blocks"][2]["standard_deviations"][0].is_null());
  EXPECT_EQ(json["blocks"][2]["undetermined_shares"][0], 1.0);
  for (const nlohmann::json& pair : json["pairs"]) {
    const Eigen::MatrixXd& C =
        covariance.tangent_blocks().at({pair["block_a"], pair["block_b"]});
    ASSERT_EQ(pair["tangent_block"].size(), static_cast<size_t>(C.rows()));
    for (int i = 0; i < C.rows(); ++i) {
      for (int j = 0; j < C.cols(); ++j) {
        EXPECT_EQ(pair["tangent_block"][i][j].get<double>(), C(i, j));
      }
    }
  }
  EXPECT_EQ(json["pairs"].size(), covariance.tangent_blocks().size());
}

// Quotes, control characters and bytes that are not UTF-8 in a name.
TEST(ToJson, AnyNameIsValidText) {
  const nlohmann::json json = Read(Sums().ComputeCovariance());
  EXPECT_EQ(json["blocks"][1]["name"], "y\"\n\xef\xbf\xbd");
}

TEST(ToJson, NumbersThatAreNotFiniteAreNull) {
  MinimizerSummary summary;
  summary.initial_cost = kInfinity;
  summary.final_cost = std::numeric_limits<double>::quiet_NaN();
  summary.total_time_in_seconds = 5e-324;
  const nlohmann::json json = Read(summary);
  EXPECT_TRUE(json["initial_cost"].is_null());
  EXPECT_TRUE(json["final_cost"].is_null());
  EXPECT_EQ(json["total_time_in_seconds"].get<double>(), 5e-324);
}

TEST(ToJson, ADomainFailureAtTheStartIsOne) {
  DomainFailure failure = SomeDomainFailure();
  EXPECT_EQ(Read(failure)["is_start"], false);
  failure.is_start = true;
  EXPECT_EQ(Read(failure)["is_start"], true);
}

TEST(ToJson, EveryReasonHasItsName) {
  using Reason = DomainFailure::Reason;
  DomainFailure failure;
  for (const auto& [reason, name] :
       {std::pair(Reason::kPlus, "plus"),
        std::pair(Reason::kReturned, "returned"),
        std::pair(Reason::kResidual, "residual"),
        std::pair(Reason::kCost, "cost"),
        std::pair(Reason::kJacobian, "jacobian")}) {
    failure.reason = reason;
    EXPECT_EQ(Read(failure)["reason"], name);
  }
}

}  // namespace json_test
}  // namespace invgrad
