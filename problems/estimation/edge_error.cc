// The errors of edges, as Ceres' cost functions.

#include <string>

#include "ceres/autodiff_cost_function.h"
#include "fmt/core.h"
#include "glog/logging.h"
#include "problems/estimation/information.h"
#include "problems/estimation/motion.h"
#include "problems/estimation/pose_graph.h"

namespace invgrad {
namespace {

using EdgeKind = PoseGraph::EdgeKind;

// Of the coordinates of a motion.
constexpr int SizeOf(int dimension) { return dimension == 2 ? 3 : 6; }

template <int kSize, typename T>
void Weigh(const Eigen::Matrix<double, kSize, kSize>& weights,
           const Eigen::Matrix<T, kSize, 1>& error,
           T* residual) {
  Eigen::Map<Eigen::Matrix<T, kSize, 1>> weighted(residual);
  weighted = weights.lazyProduct(error);
}

// Coordinates((P_a Z)^-1 X_a^-1 X_b P_b).
template <int kDimension>
struct RelativeError {
  EIGEN_MAKE_ALIGNED_OPERATOR_NEW
  static constexpr int kSize = SizeOf(kDimension);
  Motion<double, kDimension> measurement;  // P_a Z
  Motion<double, kDimension> sensor;       // P_b
  Eigen::Matrix<double, kSize, kSize> weights;

  template <typename T>
  bool operator()(const T* a, const T* b, T* residual) const {
    return Evaluate(ToMotion(a), ToMotion(b), residual);
  }
  template <typename T>
  bool operator()(const T* p_a,
                  const T* q_a,
                  const T* p_b,
                  const T* q_b,
                  T* residual) const {
    return Evaluate(ToMotion(p_a, q_a), ToMotion(p_b, q_b), residual);
  }
  template <typename T>
  bool Evaluate(const Motion<T, kDimension>& a,
                const Motion<T, kDimension>& b,
                T* residual) const {
    const Motion<T, kDimension> seen =
        SeenFrom(a, b) * sensor.template Cast<T>();
    Weigh(weights,
          Coordinates(SeenFrom(measurement.template Cast<T>(), seen)),
          residual);
    return true;
  }
};

// Coordinates(Z^-1 X P).
template <int kDimension>
struct PriorError {
  EIGEN_MAKE_ALIGNED_OPERATOR_NEW
  static constexpr int kSize = SizeOf(kDimension);
  Motion<double, kDimension> measurement;
  Motion<double, kDimension> sensor;
  Eigen::Matrix<double, kSize, kSize> weights;

  template <typename T>
  bool operator()(const T* pose, T* residual) const {
    return Evaluate(ToMotion(pose), residual);
  }
  template <typename T>
  bool operator()(const T* p, const T* q, T* residual) const {
    return Evaluate(ToMotion(p, q), residual);
  }
  template <typename T>
  bool Evaluate(const Motion<T, kDimension>& pose, T* residual) const {
    const Motion<T, kDimension> seen = pose * sensor.template Cast<T>();
    Weigh(weights,
          Coordinates(SeenFrom(measurement.template Cast<T>(), seen)),
          residual);
    return true;
  }
};

// P^-1 X^-1 l - z.
template <int kDimension>
struct LandmarkError {
  EIGEN_MAKE_ALIGNED_OPERATOR_NEW
  static constexpr int kSize = kDimension;
  Motion<double, kDimension> sensor;
  Eigen::Matrix<double, kDimension, 1> measurement;
  Eigen::Matrix<double, kDimension, kDimension> weights;

  template <typename T>
  bool operator()(const T* pose, const T* landmark, T* residual) const {
    return Evaluate(ToMotion(pose), landmark, residual);
  }
  template <typename T>
  bool operator()(const T* p,
                  const T* q,
                  const T* landmark,
                  T* residual) const {
    return Evaluate(ToMotion(p, q), landmark, residual);
  }
  template <typename T>
  bool Evaluate(const Motion<T, kDimension>& pose,
                const T* landmark,
                T* residual) const {
    using Point = Eigen::Matrix<T, kDimension, 1>;
    const Point position = Eigen::Map<const Point>(landmark);
    const Point error =
        SeenFrom(sensor.template Cast<T>(), SeenFrom(pose, position)) -
        measurement.template cast<T>();
    Weigh(weights, error, residual);
    return true;
  }
};

// Ceres' error between poses.
struct CeresError2d {
  EIGEN_MAKE_ALIGNED_OPERATOR_NEW
  static constexpr int kSize = 3;
  Eigen::Vector3d measurement;
  Eigen::Matrix3d weights;

  template <typename T>
  bool operator()(const T* a, const T* b, T* residual) const {
    const Motion<T, 2> seen = SeenFrom(ToMotion(a), ToMotion(b));
    const Eigen::Matrix<T, 3, 1> error(
        seen.translation[0] - measurement[0],
        seen.translation[1] - measurement[1],
        NormalizeAngle(T(seen.rotation.angle() - measurement[2])));
    Weigh(weights, error, residual);
    return true;
  }
};

struct CeresError3d {
  EIGEN_MAKE_ALIGNED_OPERATOR_NEW
  static constexpr int kSize = 6;
  Motion<double, 3> measurement;
  Eigen::Matrix<double, 6, 6> weights;

  template <typename T>
  bool operator()(const T* p_a,
                  const T* q_a,
                  const T* p_b,
                  const T* q_b,
                  T* residual) const {
    const Motion<T, 3> seen = SeenFrom(ToMotion(p_a, q_a), ToMotion(p_b, q_b));
    const Motion<T, 3> measured = measurement.template Cast<T>();
    Eigen::Matrix<T, 6, 1> error;
    error << seen.translation - measured.translation,
        T(2.0) * (measured.rotation * seen.rotation.conjugate()).vec();
    Weigh(weights, error, residual);
    return true;
  }
};

// In 2D a pose is one parameter block, in 3D two. `kSizes`: of the blocks.
template <int... kSizes, typename Error>
ceres::CostFunction* MakeCost(Error* error) {
  return new ceres::AutoDiffCostFunction<Error, Error::kSize, kSizes...>(error);
}

ceres::CostFunction* MakeCeresError(EdgeError edge_error,
                                    const PoseGraph::Edge& edge) {
  Eigen::MatrixXd weights;
  CHECK(UpperRoot(edge.information, &weights));
  if (edge_error == EdgeError::kCeres) weights.transposeInPlace();
  if (edge.measurement.size() == 3) {
    return MakeCost<3, 3>(new CeresError2d{edge.measurement, weights});
  }
  return MakeCost<3, 4, 3, 4>(
      new CeresError3d{ToMotion<3>(edge.measurement.data()), weights});
}

template <int kDimension>
ceres::CostFunction* MakeG2oError(const PoseGraph& graph,
                                  const PoseGraph::Edge& edge) {
  constexpr bool kIs2d = kDimension == 2;
  Eigen::MatrixXd weights;
  CHECK(UpperRoot(edge.information, &weights));
  const auto sensor = OffsetMotion<kDimension>(graph, edge.offset_from);
  const double* measurement = edge.measurement.data();
  if (edge.kind == EdgeKind::kLandmark) {
    auto* error =
        new LandmarkError<kDimension>{sensor, edge.measurement, weights};
    if constexpr (kIs2d)
      return MakeCost<3, 2>(error);
    else
      return MakeCost<3, 4, 3>(error);
  }
  if (edge.kind == EdgeKind::kPrior) {
    auto* error = new PriorError<kDimension>{
        ToMotion<kDimension>(measurement), sensor, weights};
    if constexpr (kIs2d)
      return MakeCost<3>(error);
    else
      return MakeCost<3, 4>(error);
  }
  auto* error = new RelativeError<kDimension>{
      sensor * ToMotion<kDimension>(measurement),
      OffsetMotion<kDimension>(graph, edge.offset_to),
      weights};
  if constexpr (kIs2d)
    return MakeCost<3, 3>(error);
  else
    return MakeCost<3, 4, 3, 4>(error);
}

bool IsPlain(const PoseGraph::Edge& edge) {
  return edge.kind == EdgeKind::kRelative && edge.offset_from < 0 &&
         edge.offset_to < 0;
}

}  // namespace

bool HasEdgeError(const PoseGraph& graph,
                  EdgeError edge_error,
                  std::string* error) {
  if (edge_error == EdgeError::kG2o) return true;
  for (const PoseGraph::Edge& edge : graph.edges) {
    if (!IsPlain(edge)) {
      *error =
          "Ceres' error is defined for EDGE_SE2 and EDGE_SE3:QUAT only; there "
          "are other edges";
      return false;
    }
    if (edge_error == EdgeError::kCeres && !IsDefinite(edge.information)) {
      *error = fmt::format(
          "the information of the edge from {} to {} is not positive definite, "
          "and has no lower Cholesky factor; use the upper one",
          graph.ids[edge.from],
          graph.ids[edge.to]);
      return false;
    }
  }
  return true;
}

ceres::CostFunction* MakeEdgeError(const PoseGraph& graph,
                                   EdgeError edge_error,
                                   const PoseGraph::Edge& edge) {
  if (edge_error != EdgeError::kG2o) {
    CHECK(IsPlain(edge));
    return MakeCeresError(edge_error, edge);
  }
  return graph.dimension == 2 ? MakeG2oError<2>(graph, edge)
                              : MakeG2oError<3>(graph, edge);
}

}  // namespace invgrad
