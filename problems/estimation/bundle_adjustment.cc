#include "problems/estimation/bundle_adjustment.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "ceres/autodiff_cost_function.h"
#include "ceres/rotation.h"
#include "fmt/core.h"
#include "problems/estimation/estimation.h"

namespace invgrad {

namespace {

struct ReprojectionError {
  double x;
  double y;

  template <typename T>
  bool operator()(const T* camera, const T* point, T* residual) const {
    T P[3];
    ceres::AngleAxisRotatePoint(camera, point, P);
    P[0] += camera[3];
    P[1] += camera[4];
    P[2] += camera[5];
    const T p[2] = {-P[0] / P[2], -P[1] / P[2]};
    const T square = p[0] * p[0] + p[1] * p[1];
    const T scale =
        camera[6] * (1.0 + square * (camera[7] + camera[8] * square));
    residual[0] = scale * p[0] - x;
    residual[1] = scale * p[1] - y;
    return true;
  }
};

Eigen::Vector3d Rotate(const Eigen::Vector3d& angle_axis,
                       const Eigen::Vector3d& vector) {
  Eigen::Vector3d rotated;
  ceres::AngleAxisRotatePoint(angle_axis.data(), vector.data(), rotated.data());
  return rotated;
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double SceneSize(const BalData& data) {
  Eigen::Vector3d median;
  for (int i = 0; i < 3; ++i) {
    const Eigen::VectorXd row = data.points.row(i);
    median[i] = Median({row.begin(), row.end()});
  }
  const Eigen::VectorXd distances =
      (data.points.colwise() - median).colwise().norm();
  return Median({distances.begin(), distances.end()});
}

}  // namespace

ceres::CostFunction* MakeReprojectionError(double x, double y) {
  return new ceres::AutoDiffCostFunction<ReprojectionError, 2, 9, 3>(
      new ReprojectionError{x, y});
}

void AddBundleAdjustment(const MakeLossFunction& make_loss,
                         BalData* data,
                         ceres::Problem* problem) {
  for (const BalData::Observation& observation : data->observations) {
    problem->AddResidualBlock(
        MakeReprojectionError(observation.x, observation.y),
        make_loss(),
        data->cameras.col(observation.camera).data(),
        data->points.col(observation.point).data());
  }
}

std::shared_ptr<ceres::ParameterBlockOrdering> PointsFirst(BalData* data) {
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (const BalData::Observation& observation : data->observations) {
    ordering->AddElementToGroup(data->points.col(observation.point).data(), 0);
    ordering->AddElementToGroup(data->cameras.col(observation.camera).data(),
                                1);
  }
  return ordering;
}

Eigen::Vector3d CameraCenter(const Eigen::Matrix<double, 9, 1>& camera) {
  return -Rotate(-camera.head<3>(), camera.segment<3>(3));
}

void PerturbBundleAdjustment(double sigma, NumpyRandom* random, BalData* data) {
  const double size = SceneSize(*data);
  for (Eigen::Index j = 0; j < data->points.cols(); ++j) {
    data->points.col(j) += sigma * size * random->Normal(3);
  }
  for (Eigen::Index j = 0; j < data->cameras.cols(); ++j) {
    Eigen::Matrix<double, 9, 1> camera = data->cameras.col(j);
    const Eigen::Vector3d center =
        CameraCenter(camera) + sigma * size * random->Normal(3);
    camera.head<3>() += sigma * random->Normal(3);
    camera.segment<3>(3) = -Rotate(camera.head<3>(), center);
    data->cameras.col(j) = camera;
  }
}

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
