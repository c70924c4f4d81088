// How exactly do I know my parameters, if some of them are not determined? A
// surveyor measures distances between stations, and no station is fixed.
//
// compute_covariance.md explains this program piece by piece.
//
//   compute_covariance

#include <array>
#include <cmath>
#include <iostream>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/covariance.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/covariance.h"
#include "invgrad/to_json.h"
#include "nlohmann/json.hpp"

namespace {

using invgrad::AllPairs;
using invgrad::ComputeCovariance;
using invgrad::Covariance;

// [distance]
constexpr double kDeviation = 0.01;  // of a measured distance [m]

struct Distance {
  template <typename T>
  bool operator()(const T* a, const T* b, T* r) const {
    using std::hypot;
    r[0] = (hypot(b[0] - a[0], b[1] - a[1]) - measured) / kDeviation;
    return true;
  }
  double measured;  // [m]
};
// [/distance]

// [survey]
struct Survey {
  std::array<double, 2> stations[5] = {
      {0.0, 0.0}, {40.0, 0.0}, {40.0, 30.0}, {0.0, 30.0}, {60.0, 15.0}};

  void Measure(int i, int j, double distance, ceres::Problem* problem) {
    problem->AddResidualBlock(
        new ceres::AutoDiffCostFunction<Distance, 1, 2, 2>(
            new Distance{distance}),
        nullptr,
        stations[i].data(),
        stations[j].data());
  }
};
// [/survey]

// [of_distance]
// The standard deviation of the distance of stations i and j, to first order.
double DistanceDeviation(const Survey& survey,
                         const Covariance& covariance,
                         int i,
                         int j) {
  const double* a = survey.stations[i].data();
  const double* b = survey.stations[j].data();
  const Eigen::Vector2d g =
      Eigen::Vector2d(b[0] - a[0], b[1] - a[1]).normalized();
  const Eigen::MatrixXd C =
      covariance.AmbientBlock(a, a) + covariance.AmbientBlock(b, b) -
      covariance.AmbientBlock(a, b) - covariance.AmbientBlock(b, a);
  return std::sqrt(g.dot(C * g));
}
// [/of_distance]

}  // namespace

int main() {
  // [measure]
  Survey survey;
  ceres::Problem problem;
  survey.Measure(0, 1, 40.008, &problem);
  survey.Measure(1, 2, 29.995, &problem);
  survey.Measure(2, 3, 40.003, &problem);
  survey.Measure(3, 0, 30.011, &problem);
  survey.Measure(0, 2, 50.002, &problem);
  survey.Measure(1, 3, 49.991, &problem);
  survey.Measure(2, 4, 25.004, &problem);  // nobody has seen station 4 from 1
  ceres::Solver::Summary summary;
  ceres::Solve({}, &problem, &summary);
  std::cout << summary.BriefReport() << "\n\n";
  // [/measure]

  // [ceres]
  ceres::Covariance of_ceres({});
  std::vector<const double*> stations;
  for (const auto& station : survey.stations) {
    stations.push_back(station.data());
  }
  const bool is_known = of_ceres.Compute(stations, &problem);
  std::cout << "ceres::Covariance: " << (is_known ? "computed" : "none")
            << "\n\n";
  // [/ceres]

  // [covariance]
  Covariance::Options options;
  options.rank.block_name = [&survey](const double* values) {
    for (int i = 0; i < 5; ++i) {
      if (values == survey.stations[i].data()) {
        return "station " + std::to_string(i);
      }
    }
    return std::string();
  };
  Covariance covariance;
  std::string error;
  if (!ComputeCovariance(
          options, problem, AllPairs(stations), &covariance, &error)) {
    std::cerr << error << "\n";
    return 1;
  }
  std::cout << covariance.ToText(/*min_correlation=*/0.5, /*max_items=*/10)
            << "\n";
  // [/covariance]

  // [gauge]
  std::cout << "distance 0 to 2: +/- "
            << DistanceDeviation(survey, covariance, 0, 2) << " m\n";
  // A gauge: station 0 stays, and station 1 stays on the x axis.
  problem.SetParameterBlockConstant(survey.stations[0].data());
  problem.SetManifold(survey.stations[1].data(),
                      new ceres::SubsetManifold(2, {1}));
  if (!ComputeCovariance(
          options, problem, AllPairs(stations), &covariance, &error)) {
    std::cerr << error << "\n";
    return 1;
  }
  std::cout << "in another gauge: +/- "
            << DistanceDeviation(survey, covariance, 0, 2) << " m\n"
            << covariance.ToText(/*min_correlation=*/0.9) << "\n";
  // [/gauge]

  // [json]
  const nlohmann::ordered_json json = covariance;
  std::cout << invgrad::JsonText(json);
  // [/json]
  return 0;
}
