#include "problems/estimation/bundle_adjustment.h"

#include <vector>

#include "ceres/autodiff_cost_function.h"
#include "ceres/rotation.h"

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

}  // namespace invgrad
