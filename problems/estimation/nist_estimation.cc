#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "fmt/core.h"
#include "problems/estimation/estimation.h"
#include "problems/estimation/nist_file.h"
#include "problems/estimation/nist_models.h"

namespace invgrad {

namespace {

constexpr int kNumCurvePoints = 400;

std::vector<double> ToVector(const Eigen::VectorXd& values) {
  return {values.begin(), values.end()};
}

class NistEstimation final : public Estimation {
 public:
  NistEstimation(EstimationTraits traits,
                 const NistData& data,
                 const NistModel& model)
      : Estimation(std::move(traits)),
        data_(data),
        model_(model),
        b_(data.starts.col(0)) {}

  void SetStart(int start) override { b_ = data_.starts.col(start); }

  // Relative to the size of each parameter.
  void Perturb(double sigma, NumpyRandom* random) override {
    const Eigen::VectorXd noise =
        sigma * random->Normal(data_.num_parameters());
    b_.array() *= 1.0 + noise.array();
  }

  std::unique_ptr<ceres::Problem> MakeProblem(
      const MakeLossFunction& make_loss) override {
    auto problem = std::make_unique<ceres::Problem>();
    for (Eigen::Index i = 0; i < data_.responses.size(); ++i) {
      const Eigen::VectorXd x = data_.predictors.row(i);
      problem->AddResidualBlock(model_.make_cost(x.data(), data_.responses[i]),
                                make_loss(),
                                b_.data());
    }
    return problem;
  }

  std::vector<LinearBlock> LinearParameters() override {
    if (model_.linear.empty()) return {};
    return {{b_.data(), model_.linear}};
  }

  std::optional<Eigen::VectorXd> Digits() const override {
    return LogRelativeErrors(b_, data_.certified);
  }

  std::optional<bool> IsSolved(double /*initial_cost*/,
                               double /*final_cost*/) const override {
    return IsNistSolution(*Digits());
  }

  std::string BlockName(const double* /*values*/) const override { return "b"; }

  std::optional<Eigen::VectorXd> DeviationDigits(
      const Covariance& covariance) const override {
    return LogRelativeErrors(covariance.block(b_.data()).standard_deviations,
                             data_.standard_deviations);
  }

  // The estimates replace both starts.
  bool Write(const std::string& path, std::string* error) const override {
    NistData result = data_;
    result.starts.colwise() = b_;
    return WriteNistFile(path, result, error);
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
    const Eigen::MatrixXd C = covariance.TangentBlock(b_.data(), b_.data());
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
  // The predictor, or, if there are several, the numbers of the observations.
  static std::vector<double> Places(const Eigen::MatrixXd& predictors) {
    const Eigen::Index m = predictors.rows();
    return ToVector(predictors.cols() == 1
                        ? Eigen::VectorXd(predictors.col(0))
                        : Eigen::VectorXd::LinSpaced(m, 1.0, m));
  }

  // Where a curve is drawn: along the predictor, or at the data.
  Eigen::MatrixXd CurvePoints() const {
    if (data_.predictors.cols() > 1) return data_.predictors;
    return Eigen::VectorXd::LinSpaced(kNumCurvePoints + 1,
                                      data_.predictors.minCoeff(),
                                      data_.predictors.maxCoeff());
  }

  Series Curve(const std::string& title, const Eigen::MatrixXd& points) const {
    Series curve;
    curve.title = title;
    curve.x = Places(points);
    for (const Eigen::VectorXd x : points.rowwise()) {
      curve.y.push_back(model_.value(x.data(), b_.data()));
    }
    return curve;
  }

  // df/db at x; a residual is y - f.
  Eigen::VectorXd Gradient(const Eigen::VectorXd& x) const {
    const std::unique_ptr<ceres::CostFunction> cost(
        model_.make_cost(x.data(), 1.0));
    const double* parameters = b_.data();
    double residual = 0.0;
    Eigen::VectorXd gradient(b_.size());
    double* jacobian = gradient.data();
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    if (!cost->Evaluate(&parameters, &residual, &jacobian)) {
      gradient.setConstant(kNaN);
    }
    return -gradient;
  }

  Plot DataPanel() const {
    Plot plot;
    plot.title = data_.name;
    plot.x_label = data_.predictors.cols() == 1 ? "x" : "observation";
    plot.y_label = model_.log_response ? "log y" : "y";
    Series points;
    points.title = "data";
    points.style = Series::Style::kPoints;
    points.y = ToVector(data_.responses);
    if (model_.log_response) {
      for (double& y : points.y) y = std::log(y);
    }
    points.x = Places(data_.predictors);
    // The range of the data: a start may be orders of magnitude away.
    const auto [low, high] =
        std::minmax_element(points.y.begin(), points.y.end());
    const double margin = 0.15 * (*high - *low);
    if (margin > 0.0) plot.y_range = {*low - margin, *high + margin};
    plot.series.push_back(std::move(points));
    return plot;
  }

  const NistData data_;
  const NistModel& model_;
  Eigen::VectorXd b_;
};

// Whether the certified parameters have the certified sum of squares, up to
// their ten digits. For an almost exact fit the sum consists of rounding
// errors.
bool FitsCertificate(const NistModel& model, const NistData& data) {
  const double tolerance = 1e-6 * data.certified_sum_of_squares +
                           1e-12 * data.responses.squaredNorm();
  return std::abs(SumOfSquares(model, data, data.certified) -
                  data.certified_sum_of_squares) <= tolerance;
}

}  // namespace

std::unique_ptr<Estimation> ReadNistEstimation(
    const std::string& path,
    const ReadEstimationOptions& /*options*/,
    std::string* error) {
  NistData data;
  if (!ReadNistFile(path, &data, error)) return nullptr;
  std::string why;
  const NistModel* model = FindNistModel(data, &why);
  if (model == nullptr) {
    *error = path + ": " + why;
    return nullptr;
  }
  if (model->log_response && data.responses.minCoeff() <= 0.0) {
    *error = path + ": a response is not positive; its logarithm is needed";
    return nullptr;
  }
  if (!FitsCertificate(*model, data)) {
    *error = fmt::format(
        "{}: the certified parameters do not give the certified sum of "
        "squares: "
        "a number is cut off, or the model is not {}",
        path,
        model->formula);
    return nullptr;
  }
  EstimationTraits traits;
  traits.description = fmt::format("{} observations, {} parameters; {}",
                                   data.responses.size(),
                                   data.num_parameters(),
                                   model->formula);
  traits.linear_solver = "dense_qr";
  traits.extension = ".dat";
  traits.num_starts = static_cast<int>(data.starts.cols());
  // Full accuracy, as in Ceres' examples/nist.cc.
  MinimizerOptions& budget = traits.budget;
  budget.max_num_iterations = 10000;
  budget.gradient_tolerance = budget.function_tolerance =
      budget.parameter_tolerance = std::numeric_limits<double>::epsilon();
  return std::make_unique<NistEstimation>(traits, data, *model);
}

}  // namespace invgrad
