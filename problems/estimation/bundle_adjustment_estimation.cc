#include <algorithm>
#include <utility>
#include <vector>

#include "fmt/core.h"
#include "problems/estimation/bundle_adjustment.h"
#include "problems/estimation/estimation.h"

namespace invgrad {
namespace {

constexpr int kMaxPointsDrawn = 6000;

// The range without the fraction `tail` at each end, plus a margin.
AxisRange QuantileRange(std::vector<double> values, double tail) {
  std::sort(values.begin(), values.end());
  const size_t cut = static_cast<size_t>(tail * values.size());
  const double low = values[cut];
  const double high = values[values.size() - 1 - cut];
  const double margin = 0.1 * (high - low);
  return margin > 0.0 ? AxisRange{low - margin, high + margin} : AxisRange{};
}

AxisRange Union(const AxisRange& a, const AxisRange& b) {
  if (!a.low.has_value()) return b;
  if (!b.low.has_value()) return a;
  return {std::min(*a.low, *b.low), std::max(*a.high, *b.high)};
}

class BalEstimation final : public Estimation {
 public:
  BalEstimation(EstimationTraits traits, const BalData& data)
      : Estimation(std::move(traits)), start_(data), data_(data) {}

  void SetStart(int /*start*/) override { data_ = start_; }

  void Perturb(double sigma, NumpyRandom* random) override {
    PerturbBundleAdjustment(sigma, random, &data_);
  }

  std::unique_ptr<ceres::Problem> MakeProblem(
      const MakeLossFunction& make_loss) override {
    auto problem = std::make_unique<ceres::Problem>();
    AddBundleAdjustment(make_loss, &data_, problem.get());
    return problem;
  }

  std::shared_ptr<ceres::ParameterBlockOrdering> MakeOrdering() override {
    return PointsFirst(&data_);
  }

  std::string BlockName(const double* values) const override {
    const Eigen::Index camera = values - data_.cameras.data();
    if (camera >= 0 && camera < data_.cameras.size()) {
      return fmt::format("camera {}", camera / data_.cameras.rows());
    }
    return fmt::format("point {}",
                       (values - data_.points.data()) / data_.points.rows());
  }

  // The cameras.
  std::vector<Covariance::Pair> CovariancePairs(
      const ceres::Problem& problem) const override {
    std::vector<Covariance::Pair> pairs;
    for (Eigen::Index j = 0; j < data_.cameras.cols(); ++j) {
      const double* camera = data_.cameras.col(j).data();
      if (problem.HasParameterBlock(camera)) pairs.emplace_back(camera, camera);
    }
    return pairs;
  }

  bool Write(const std::string& path, std::string* error) const override {
    return WriteBalFile(path, data_, error);
  }

  // Top view: the cameras of these data sets look along a horizontal axis.
  void Draw(const std::string& label,
            std::vector<Plot>* panels) const override {
    Plot plot;
    plot.title = label;
    plot.x_label = "x";
    plot.y_label = "z";
    plot.equal_aspect = true;
    Series points;
    points.title = "points";
    points.style = Series::Style::kPoints;
    const Eigen::Index stride = data_.points.cols() / kMaxPointsDrawn + 1;
    for (Eigen::Index j = 0; j < data_.points.cols(); j += stride) {
      points.x.push_back(data_.points(0, j));
      points.y.push_back(data_.points(2, j));
    }
    Series cameras;
    cameras.title = "cameras";
    cameras.style = Series::Style::kPoints;
    for (Eigen::Index j = 0; j < data_.cameras.cols(); ++j) {
      const Eigen::Vector3d center = CameraCenter(data_.cameras.col(j));
      cameras.x.push_back(center[0]);
      cameras.y.push_back(center[2]);
    }
    // Quantiles, because some points are far away. All panels have the ranges
    // of the first panel.
    if (panels->empty()) {
      plot.x_range =
          Union(QuantileRange(points.x, 0.02), QuantileRange(cameras.x, 0.0));
      plot.y_range =
          Union(QuantileRange(points.y, 0.02), QuantileRange(cameras.y, 0.0));
    } else {
      plot.x_range = panels->front().x_range;
      plot.y_range = panels->front().y_range;
    }
    plot.series.push_back(std::move(points));
    plot.series.push_back(std::move(cameras));
    panels->push_back(std::move(plot));
  }

 private:
  const BalData start_;
  BalData data_;
};

}  // namespace

std::unique_ptr<Estimation> ReadBalEstimation(
    const std::string& path,
    const ReadEstimationOptions& /*options*/,
    std::string* error) {
  BalData data;
  if (!ReadBalFile(path, &data, error)) return nullptr;
  EstimationTraits traits;
  traits.description = fmt::format("{} cameras, {} points, {} observations",
                                   data.cameras.cols(),
                                   data.points.cols(),
                                   data.observations.size());
  // With few cameras the reduced camera matrix is dense.
  traits.linear_solver =
      data.cameras.cols() <= 500 ? "dense_schur" : "sparse_schur";
  traits.extension = ".txt";
  return std::make_unique<BalEstimation>(traits, data);
}

}  // namespace invgrad
