#include "problems/estimation/regression_estimation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "fmt/core.h"
#include "invgrad/internal/small_covariance.h"
#include "problems/estimation/nist_models.h"

namespace invgrad {

namespace {

constexpr int kNumCurvePoints = 400;

std::vector<double> ToVector(const Eigen::VectorXd& values) {
  return {values.begin(), values.end()};
}

// As in Covariance::ToText.
std::string DeviationText(const Covariance::Block& block) {
  const double deviation = block.standard_deviations[0];
  const double share = block.undetermined_shares[0];
  if (!block.at_bound.empty()) return " (at its bound)";
  if (!std::isfinite(deviation)) return " (not determined)";
  return share > kLeastUndeterminedShare
             ? fmt::format(" (no error bar: {:.3g} % not determined)",
                           100.0 * share)
             : fmt::format(" +/- {:.3g}", deviation);
}

class RegressionEstimation final : public Estimation {
 public:
  RegressionEstimation(EstimationTraits traits, Regression regression)
      : Estimation(std::move(traits)),
        regression_(std::move(regression)),
        b_(regression_.starts.col(0)),
        block_size_(regression_.names.empty() ? static_cast<int>(b_.size())
                                              : 1) {}

  void SetStart(int start) override { b_ = regression_.starts.col(start); }

  // Relative to the size of each parameter.
  void Perturb(double sigma, NumpyRandom* random) override {
    const Eigen::VectorXd noise =
        sigma * random->Normal(static_cast<int>(b_.size()));
    b_.array() *= 1.0 + noise.array();
    if (regression_.lower_bounds.size() > 0) {
      b_ = b_.cwiseMax(regression_.lower_bounds)
               .cwiseMin(regression_.upper_bounds);
    }
  }

  std::unique_ptr<ceres::Problem> MakeProblem(
      const MakeLossFunction& make_loss) override {
    auto problem = std::make_unique<ceres::Problem>();
    for (double* block : Blocks())
      problem->AddParameterBlock(block, block_size_);
    for (Eigen::Index i = 0; i < regression_.responses.size(); ++i) {
      // It would count as an observation in the variance of the residuals.
      if (regression_.weights[i] == 0.0) continue;
      const Eigen::VectorXd x = regression_.predictors.row(i);
      problem->AddResidualBlock(
          regression_.make_cost(
              x.data(), regression_.responses[i], regression_.weights[i]),
          make_loss(),
          Blocks());
    }
    for (Eigen::Index i = 0; i < regression_.lower_bounds.size(); ++i) {
      double* block = b_.data() + i / block_size_ * block_size_;
      const int index = static_cast<int>(i) % block_size_;
      problem->SetParameterLowerBound(
          block, index, regression_.lower_bounds[i]);
      problem->SetParameterUpperBound(
          block, index, regression_.upper_bounds[i]);
    }
    return problem;
  }

  std::vector<LinearBlock> LinearParameters() override {
    if (regression_.linear.empty()) return {};
    return {{b_.data(), regression_.linear}};
  }

  std::optional<Eigen::VectorXd> Digits() const override {
    if (regression_.certified.size() == 0) return {};
    return LogRelativeErrors(b_, regression_.certified);
  }

  std::optional<bool> IsSolved(double /*initial_cost*/,
                               double /*final_cost*/) const override {
    const std::optional<Eigen::VectorXd> digits = Digits();
    if (!digits) return {};
    return IsNistSolution(*digits);
  }

  double ConstantCost() const override {
    const Eigen::ArrayXd y = regression_.responses.array();
    const Eigen::ArrayXd w = regression_.weights.array().square();
    const double mean = (w * y).sum() / w.sum();
    return 0.5 * (w * (y - mean).square()).sum();
  }

  // The costs are without a robust loss, which a run may have.
  std::string Doubt() const override {
    const Eigen::ArrayXd y = regression_.responses.array();
    const Eigen::ArrayXd w = regression_.weights.array().square();
    Eigen::ArrayXd f(y.size());
    for (Eigen::Index i = 0; i < f.size(); ++i) {
      f[i] = y[i];
      if (w[i] == 0.0) continue;  // the model may have no value there
      const Eigen::VectorXd x = regression_.predictors.row(i);
      f[i] = regression_.value(x.data(), b_.data());
    }
    const double of_constant = ConstantCost();
    const double of_model = 0.5 * (w * (y - f).square()).sum();
    constexpr double kNoBetter = 0.99;
    // One parameter may be the constant.
    return b_.size() > 1 && of_constant > 0.0 &&
                   of_model >= kNoBetter * of_constant
               ? "the model explains the data no better than a constant"
               : "";
  }

  std::string BlockName(const double* values) const override {
    return regression_.names.empty() ? "b"
                                     : regression_.names[values - b_.data()];
  }

  std::string EstimateText(const Covariance* covariance) const override {
    std::string text;
    for (std::size_t i = 0; i < regression_.names.size(); ++i) {
      const double* value = b_.data() + i;
      text += fmt::format(
          "{}{} = {:.8g}", i == 0 ? "" : ", ", regression_.names[i], *value);
      if (covariance != nullptr)
        text += DeviationText(covariance->block(value));
    }
    return text;
  }

  // Those of all parameters, which the band of two deviations needs.
  std::vector<Covariance::Pair> CovariancePairs(
      const ceres::Problem& /*problem*/) const override {
    std::vector<Covariance::Pair> pairs;
    const std::vector<double*> blocks = Blocks();
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      for (std::size_t j = i; j < blocks.size(); ++j) {
        pairs.emplace_back(blocks[i], blocks[j]);
      }
    }
    return pairs;
  }

  std::optional<Eigen::VectorXd> DeviationDigits(
      const Covariance& covariance) const override {
    if (regression_.certified_deviations.size() == 0) return {};
    return LogRelativeErrors(CovarianceOfAll(covariance).diagonal().cwiseSqrt(),
                             regression_.certified_deviations);
  }

  bool Write(const std::string& path, std::string* error) const override {
    return regression_.write(path, b_, error);
  }

  void Draw(const std::string& label,
            std::vector<Plot>* panels) const override {
    if (panels->empty()) panels->push_back(DataPanel());
    panels->front().series.push_back(Curve(label, CurvePoints()));
  }

  void DrawCovariance(const std::string& label,
                      const Covariance& covariance,
                      std::vector<Plot>* panels) const override {
    const Eigen::MatrixXd points = CurvePoints();
    const Eigen::MatrixXd C = CovarianceOfAll(covariance);
    Series curve = Curve("estimate, two standard deviations", points);
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      const Eigen::VectorXd g = Gradient(points.row(i));
      const double deviation = std::sqrt(g.dot(C * g));
      curve.y_low.push_back(curve.y[i] - 2.0 * deviation);
      curve.y_high.push_back(curve.y[i] + 2.0 * deviation);
    }
    Plot plot = DataPanel();
    plot.title += ", " + label;
    plot.series.push_back(std::move(curve));
    panels->push_back(std::move(plot));
  }

 private:
  std::vector<double*> Blocks() const {
    std::vector<double*> blocks;
    for (Eigen::Index i = 0; i < b_.size(); i += block_size_) {
      blocks.push_back(const_cast<double*>(b_.data()) + i);  // Ceres' type
    }
    return blocks;
  }

  Eigen::MatrixXd CovarianceOfAll(const Covariance& covariance) const {
    Eigen::MatrixXd C(b_.size(), b_.size());
    const std::vector<double*> blocks = Blocks();
    for (const double* row : blocks) {
      for (const double* column : blocks) {
        C.block(row - b_.data(), column - b_.data(), block_size_, block_size_) =
            covariance.TangentBlock(row, column);
      }
    }
    return C;
  }

  // The predictor, or, if there are several, the numbers of the observations.
  static std::vector<double> Places(const Eigen::MatrixXd& predictors) {
    const Eigen::Index m = predictors.rows();
    return ToVector(predictors.cols() == 1
                        ? Eigen::VectorXd(predictors.col(0))
                        : Eigen::VectorXd::LinSpaced(m, 1.0, m));
  }

  // Where a curve is drawn: along the predictor, or at the data.
  Eigen::MatrixXd CurvePoints() const {
    if (regression_.predictors.cols() != 1) return regression_.predictors;
    return Eigen::VectorXd::LinSpaced(kNumCurvePoints + 1,
                                      regression_.predictors.minCoeff(),
                                      regression_.predictors.maxCoeff());
  }

  Series Curve(const std::string& title, const Eigen::MatrixXd& points) const {
    Series curve;
    curve.title = title;
    curve.x = Places(points);
    for (const Eigen::VectorXd x : points.rowwise()) {
      curve.y.push_back(regression_.value(x.data(), b_.data()));
    }
    return curve;
  }

  // df/db at x; a residual is y - f.
  Eigen::VectorXd Gradient(const Eigen::VectorXd& x) const {
    const std::unique_ptr<ceres::CostFunction> cost(
        regression_.make_cost(x.data(), 1.0, 1.0));
    const std::vector<double*> blocks = Blocks();
    double residual = 0.0;
    Eigen::VectorXd gradient(b_.size());
    std::vector<double*> jacobians;
    jacobians.reserve(blocks.size());
    for (const double* block : blocks) {
      jacobians.push_back(gradient.data() + (block - b_.data()));
    }
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    if (!cost->Evaluate(blocks.data(), &residual, jacobians.data())) {
      gradient.setConstant(kNaN);
    }
    return -gradient;
  }

  Plot DataPanel() const {
    Plot plot;
    plot.title = regression_.title;
    plot.x_label = regression_.predictors.cols() == 1 ? regression_.x_label
                                                      : "observation";
    plot.y_label = regression_.y_label;
    Series points;
    points.title = "data";
    points.style = Series::Style::kPoints;
    points.y = ToVector(regression_.responses);
    if (regression_.shows_logarithms) {
      for (double& y : points.y) y = std::log(y);
    }
    points.x = Places(regression_.predictors);
    // The range of the data: a start may be orders of magnitude away.
    const auto [low, high] =
        std::minmax_element(points.y.begin(), points.y.end());
    const double margin = 0.15 * (*high - *low);
    if (margin > 0.0) plot.y_range = {*low - margin, *high + margin};
    plot.series.push_back(std::move(points));
    return plot;
  }

  const Regression regression_;
  Eigen::VectorXd b_;
  const int block_size_;
};

}  // namespace

std::unique_ptr<Estimation> MakeRegressionEstimation(EstimationTraits traits,
                                                     Regression regression) {
  traits.linear_solver = "dense_qr";
  traits.num_starts = static_cast<int>(regression.starts.cols());
  MinimizerOptions& budget = traits.budget;
  budget.max_num_iterations = 10000;
  budget.gradient_tolerance = budget.function_tolerance =
      budget.parameter_tolerance = std::numeric_limits<double>::epsilon();
  return std::make_unique<RegressionEstimation>(std::move(traits),
                                                std::move(regression));
}

}  // namespace invgrad
