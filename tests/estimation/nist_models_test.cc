#include "problems/estimation/nist_models.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "ceres/gradient_checker.h"
#include "gtest/gtest.h"
#include "tests/support/published_data.h"

namespace invgrad {
namespace nist_models_test {

const NistModel& Model(const std::string& name) {
  const std::vector<NistModel>& models = NistModels();
  return *std::find_if(models.begin(), models.end(), [&](const auto& model) {
    return model.name == name;
  });
}

// Two rows: x = 1, y = f(1; b) and the same for 2.
NistData DataOf(const NistModel& model, const Eigen::VectorXd& b) {
  NistData data;
  data.name = model.name;
  data.predictors.resize(2, model.num_predictors);
  data.predictors.row(0).setConstant(1.0);
  data.predictors.row(1).setConstant(2.0);
  data.responses.resize(2);
  for (int i = 0; i < 2; ++i) {
    const Eigen::VectorXd x = data.predictors.row(i);
    data.responses[i] = model.value(x.data(), b.data());
  }
  data.starts = b.replicate(1, 2);
  data.certified = b;
  data.standard_deviations = Eigen::VectorXd::Ones(b.size());
  return data;
}

TEST(NistModels, AreThoseOfThe27DataSets) {
  std::set<std::string> names;
  for (const NistModel& model : NistModels()) names.insert(model.name);
  EXPECT_EQ(names.size(), 27);
  EXPECT_EQ(NistModels().size(), 28);  // Roszman1 has two branches
}

TEST(NistModels, HaveTheRightDerivatives) {
  for (const NistModel& model : NistModels()) {
    SCOPED_TRACE(model.name + ": " + model.formula);
    const std::vector<double> x = {0.7, 1.1};
    const std::unique_ptr<ceres::CostFunction> cost(
        model.make_cost(x.data(), 2.0));
    ASSERT_EQ(cost->num_residuals(), 1);
    ASSERT_EQ(cost->parameter_block_sizes(),
              std::vector<int>{model.num_parameters});
    // Away from poles and from where a derivative vanishes.
    Eigen::VectorXd b(model.num_parameters);
    for (Eigen::Index i = 0; i < b.size(); ++i) b[i] = 0.6 + 0.15 * i;
    const double* parameters[] = {b.data()};
    const std::vector<const ceres::Manifold*> euclidean = {nullptr};
    const ceres::GradientChecker checker(
        cost.get(), &euclidean, ceres::NumericDiffOptions());
    ceres::GradientChecker::ProbeResults results;
    // Ridders' differences are good to some 1e-9 here.
    EXPECT_TRUE(checker.Probe(parameters, 1e-7, &results)) << results.error_log;
  }
}

// The proof, as read off the formulas: all but Chwirut are separable.
TEST(NistModels, KnowTheirLinearParameters) {
  const std::map<std::string, std::vector<int>> expected = {
      {"Misra1a", {0}},
      {"Misra1b", {0}},
      {"Misra1c", {0}},
      {"Misra1d", {0}},
      {"BoxBOD", {0}},
      {"DanWood", {0}},
      {"Chwirut1", {}},
      {"Chwirut2", {}},
      {"Lanczos1", {0, 2, 4}},
      {"Lanczos2", {0, 2, 4}},
      {"Lanczos3", {0, 2, 4}},
      {"Gauss1", {0, 2, 5}},
      {"Gauss2", {0, 2, 5}},
      {"Gauss3", {0, 2, 5}},
      {"Kirby2", {0, 1, 2}},
      {"Hahn1", {0, 1, 2, 3}},
      {"Thurber", {0, 1, 2, 3}},
      {"Nelson", {0, 1}},
      {"MGH17", {0, 1, 2}},
      {"Roszman1", {0, 1}},
      {"MGH09", {0}},
      {"ENSO", {0, 1, 2, 4, 5, 7, 8}},
      {"Rat42", {0}},
      {"MGH10", {0}},
      {"Eckerle4", {0}},
      {"Rat43", {0}},
      {"Bennett5", {0}}};
  for (const NistModel& model : NistModels()) {
    EXPECT_EQ(model.linear, expected.at(model.name)) << model.name;
  }
}

// The derivatives by the proved parameters do not change with these, and those
// by any other parameter change with it.
TEST(NistModels, AreAffineInTheirLinearParametersAndInNoOthers) {
  for (const NistModel& model : NistModels()) {
    SCOPED_TRACE(model.name + ": " + model.formula);
    const std::vector<double> x = {0.7, 1.1};
    const std::unique_ptr<ceres::CostFunction> cost(
        model.make_cost(x.data(), 2.0));
    const int n = model.num_parameters;
    const auto jacobian_at = [&](const Eigen::VectorXd& b) {
      Eigen::VectorXd J(n);
      const double* parameters[] = {b.data()};
      double* jacobians[] = {J.data()};
      double residual;
      EXPECT_TRUE(cost->Evaluate(parameters, &residual, jacobians));
      return J;
    };
    Eigen::VectorXd b(n);
    for (int i = 0; i < n; ++i) b[i] = 0.6 + 0.15 * i;
    Eigen::VectorXd moved = b;
    for (const int i : model.linear) moved[i] += 1.0 + i;
    const Eigen::VectorXd J = jacobian_at(b);
    const Eigen::VectorXd J_moved = jacobian_at(moved);
    for (int i = 0; i < n; ++i) {
      if (std::count(model.linear.begin(), model.linear.end(), i) > 0) {
        EXPECT_NEAR(J_moved[i], J[i], 1e-14 * std::abs(J[i])) << i;
        continue;
      }
      moved = b;
      moved[i] += 0.1;
      const bool is_linear_alone =  // but not with b1
          model.name == "MGH09" && i == 1;
      EXPECT_EQ(std::abs(jacobian_at(moved)[i] - J[i]) <= 1e-14,
                is_linear_alone)
          << i;
    }
  }
}

TEST(NistModels, ResidualIsResponseMinusModel) {
  const double x[] = {3.0, 2.0};
  const double b[] = {5.0, 0.1, 0.5};
  const double* parameters[] = {b};
  double residual = 0.0;
  std::unique_ptr<ceres::CostFunction> cost(Model("Misra1a").make_cost(x, 4.0));
  ASSERT_TRUE(cost->Evaluate(parameters, &residual, nullptr));
  EXPECT_NEAR(residual, 4.0 - 5.0 * (1.0 - std::exp(-0.3)), 1e-15);
  cost.reset(Model("Nelson").make_cost(x, 4.0));
  ASSERT_TRUE(cost->Evaluate(parameters, &residual, nullptr));
  EXPECT_NEAR(residual,
              std::log(4.0) - (5.0 - 0.1 * 3.0 * std::exp(-0.5 * 2.0)),
              1e-15);
}

TEST(NistModels, KnowWhichBranchOfTheArctanAFileMeans) {
  const std::vector<NistModel>& models = NistModels();
  const auto first =
      std::find_if(models.begin(), models.end(), [](const auto& model) {
        return model.name == "Roszman1";
      });
  Eigen::VectorXd b(4);
  b << 0.2, 0.3, 4.0, 5.0;  // x < b4
  std::string error;
  for (int branch = 0; branch < 2; ++branch) {
    NistData data = DataOf(first[branch], b);
    data.certified_sum_of_squares = 1e-3;
    EXPECT_EQ(FindNistModel(data, &error), &first[branch]) << branch;
  }
  // They differ by the one that b1 takes up, on both sides of b4 alike.
  for (const double x : {1.0, 4.9, 5.1, 9.0}) {
    EXPECT_NEAR(
        first[0].value(&x, b.data()) - first[1].value(&x, b.data()), 1.0, 1e-14)
        << x;
  }
  // NIST's formula, where the data are.
  const double x = 1.0;
  EXPECT_NEAR(first[0].value(&x, b.data()),
              0.2 - 0.3 - std::atan(4.0 / (1.0 - 5.0)) / std::acos(-1.0),
              1e-15);
}

TEST(NistModels, RefusesUnknownNamesAndOtherSizes) {
  Eigen::VectorXd b(2);
  b << 5.0, 0.1;
  NistData data = DataOf(Model("Misra1a"), b);
  std::string error;
  EXPECT_EQ(FindNistModel(data, &error), &Model("Misra1a")) << error;
  data.name = "Misra1x";
  EXPECT_EQ(FindNistModel(data, &error), nullptr);
  EXPECT_EQ(error,
            "'Misra1x' is not one of NIST's 27 data sets, which --list shows; "
            "expected --model=\"FORMULA\" for a model of your own");
  data.name = "Rat42";
  EXPECT_EQ(FindNistModel(data, &error), nullptr);
  for (const char* word : {"Rat42", "2 parameters", "expected 3"}) {
    EXPECT_NE(error.find(word), std::string::npos) << error;
  }
}

TEST(LogRelativeErrors, CountsDigits) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Eigen::VectorXd certified(5);
  certified << 1.0, -2.0, 1e-6, 3.0, 4.0;
  Eigen::VectorXd estimates(5);
  estimates << 1.0, -2.02, 1.001e-6, -3.0, nan;
  const Eigen::VectorXd digits = LogRelativeErrors(estimates, certified);
  EXPECT_EQ(digits[0], kMaxNistDigits);
  EXPECT_NEAR(digits[1], 2.0, 1e-12);
  EXPECT_NEAR(digits[2], 3.0, 1e-9);
  EXPECT_EQ(digits[3], 0.0);
  EXPECT_EQ(digits[4], 0.0);
  EXPECT_TRUE(IsNistSolution(Eigen::Vector2d(11.0, 4.1)));
  EXPECT_FALSE(IsNistSolution(Eigen::Vector2d(11.0, 4.0)));
}

TEST(NistModels, ReproduceTheCertifiedSumsOfSquares) {
  if (PublishedData("nist").empty()) {
    GTEST_SKIP() << "https://www.itl.nist.gov/div898/strd/nls has the files";
  }
  std::set<std::string> names;
  for (const NistModel& row : NistModels()) names.insert(row.name);
  for (const std::string& name : names) {
    SCOPED_TRACE(name);
    NistData data;
    std::string error;
    ASSERT_TRUE(
        ReadNistFile(PublishedData("nist/" + name + ".dat"), &data, &error))
        << error;
    const NistModel* model = FindNistModel(data, &error);
    ASSERT_NE(model, nullptr) << error;
    // Parameters with 11 digits move f in its 11th, and the sum of squares, at
    // its minimum, by the square of that.
    EXPECT_NEAR(SumOfSquares(*model, data, data.certified),
                data.certified_sum_of_squares,
                1e-9 * data.certified_sum_of_squares +
                    1e-18 * data.responses.squaredNorm());
  }
}

}  // namespace nist_models_test
}  // namespace invgrad
