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
  NistEstimation(NistData data, const NistModel& model)
      : data_(std::move(data)), model_(model), b_(data_.starts.col(0)) {}

  std::string Description() const override {
    return fmt::format("{} observations, {} parameters; {}",
                       data_.responses.size(),
                       data_.num_parameters(),
                       model_.formula);
  }

  int num_starts() const override {
    return static_cast<int>(data_.starts.cols());
  }

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

  // Full accuracy, as in Ceres' examples/nist.cc.
  void SetBudget(MinimizerOptions* options) const override {
    constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
    options->max_num_iterations = 10000;
    options->gradient_tolerance = kEpsilon;
    options->function_tolerance = kEpsilon;
    options->parameter_tolerance = kEpsilon;
  }

  std::string LinearSolver() const override { return "dense_qr"; }

  std::optional<Eigen::VectorXd> Digits() const override {
    return LogRelativeErrors(b_, data_.certified);
  }

  std::string Extension() const override { return ".dat"; }

  // The estimates replace both starts.
  bool Write(const std::string& path, std::string* error) const override {
    NistData result = data_;
    result.starts.colwise() = b_;
    return WriteNistFile(path, result, error);
  }

  void Draw(const std::string& label,
            std::vector<Plot>* panels) const override {
    if (panels->empty()) panels->push_back(DataPanel());
    Series curve;
    curve.title = label;
    if (data_.predictors.cols() == 1) {
      const double low = data_.predictors.minCoeff();
      const double high = data_.predictors.maxCoeff();
      for (int i = 0; i <= kNumCurvePoints; ++i) {
        const double x = low + (high - low) * i / kNumCurvePoints;
        curve.x.push_back(x);
        curve.y.push_back(model_.value(&x, b_.data()));
      }
    } else {
      for (Eigen::Index i = 0; i < data_.predictors.rows(); ++i) {
        const Eigen::VectorXd x = data_.predictors.row(i);
        curve.x.push_back(static_cast<double>(i + 1));
        curve.y.push_back(model_.value(x.data(), b_.data()));
      }
    }
    panels->front().series.push_back(std::move(curve));
  }

 private:
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
    if (data_.predictors.cols() == 1) {
      points.x = ToVector(data_.predictors.col(0));
    } else {
      for (size_t i = 0; i < points.y.size(); ++i) {
        points.x.push_back(static_cast<double>(i + 1));
      }
    }
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
    *error = path +
             ": the certified parameters do not give the certified sum "
             "of squares: a number is cut off, or the model is not " +
             model->formula;
    return nullptr;
  }
  return std::make_unique<NistEstimation>(std::move(data), *model);
}

}  // namespace invgrad
