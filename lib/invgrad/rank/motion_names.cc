#include "invgrad/rank/motion_names.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "Eigen/Geometry"
#include "fmt/core.h"
#include "fmt/ranges.h"
#include "invgrad/core/small_svd.h"
#include "invgrad/internal/qr.h"
#include "invgrad/io/format.h"
#include "invgrad/rank/decompositions.h"
#include "invgrad/rank/localized_basis.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Of numbers near 1: directions have length one, and the landmarks an rms
// distance of one from the centre.
constexpr double kNegligible = 1e-7;

// The part of span(Q), orthonormal, with zeros in these rows of Q.
MatrixXd WithZeroRows(const MatrixXd& Q, Index first, Index num) {
  if (Q.cols() == 0) return Q;
  const RightSvd svd = ComputeRightSvd(Q.middleRows(first, num));
  return Q * svd.V.rightCols((svd.s.array() <= kNegligible).count());
}

// An orthonormal basis of the span of Q's orthonormal columns, which begins with
// the unit vectors that the span contains.
MatrixXd UnitVectorsFirst(const MatrixXd& Q) {
  MatrixXd units(Q.rows(), 0);
  for (Index i = 0; i < Q.rows(); ++i) {
    const VectorXd unit = VectorXd::Unit(Q.rows(), i);
    if ((unit - Q * Q.row(i).transpose()).norm() > kNegligible) continue;
    units.conservativeResize(Eigen::NoChange, units.cols() + 1);
    units.rightCols<1>() = unit;
  }
  MatrixXd rest = OrthogonalRest(Q, units);
  for (auto direction : rest.colwise()) {
    Index largest = 0;
    direction.cwiseAbs().maxCoeff(&largest);
    if (direction[largest] < 0.0) direction = -direction;
  }
  MatrixXd basis(Q.rows(), units.cols() + rest.cols());
  basis << units, rest;
  return basis;
}

// The i of the unit vector e_i, or -1.
int Axis(const Vector3d& direction) {
  Index i = 0;
  direction.maxCoeff(&i);
  return (direction - Vector3d::Unit(i)).norm() <= kNegligible
             ? static_cast<int>(i)
             : -1;
}

// "(0.6, 0.8)"
std::string Coordinates(const VectorXd& x) {
  std::vector<std::string> entries;
  for (const double entry : x) entries.push_back(FormatNumber(entry, 4));
  return fmt::format("({})", fmt::join(entries, ", "));
}

// Velocities relative to the centre, modulo translations.
class FieldNames {
 public:
  FieldNames(const std::vector<Landmark>& landmarks,
             const Vector3d& center,
             bool in_space)
      : landmarks_(landmarks), center_(center), in_space_(in_space) {
    double sum = 0.0;
    for (const Landmark& landmark : landmarks_) {
      sum += (landmark.position - center_).squaredNorm();
    }
    if (sum > 0.0) {
      length_ = std::sqrt(sum / static_cast<double>(landmarks_.size()));
    }
  }

  std::vector<NamedField> Name(MatrixXd fields) {
    fields.topRows<3>() /= length_;
    const MatrixXd all = Orthonormalized(std::move(fields));
    const MatrixXd translations = WithZeroRows(all, 3, 4);
    translations_ = UnitVectorsFirst(translations.topRows<3>());
    for (const auto direction : translations_.colwise()) {
      MotionField field = MotionField::Zero();
      field.head<3>() = direction;
      Add("translation " + Direction(direction, "along "), field);
    }
    NameRotations(OrthogonalRest(WithZeroRows(all, 6, 1), translations));
    NameScale(OrthogonalRest(WithZeroRows(all, 3, 3), translations));
    return std::move(named_);
  }

 private:
  // Points that fields do not move, but by translations: { q : M q = v }, and
  // one of them.
  struct FixedPoints {
    MatrixXd M;
    VectorXd v;
    Vector3d point = Vector3d::Zero();
    const Landmark* landmark = nullptr;  // at the point, if there is just one

    double DistanceTo(const Vector3d& q) const { return (M * q - v).norm(); }
  };

  // fields: unit vectors delta, or e = 1.
  std::optional<FixedPoints> Find(const MatrixXd& fields) const {
    const Matrix3d P =
        Matrix3d::Identity() - translations_ * translations_.transpose();
    FixedPoints fixed;
    fixed.M.resize(3 * fields.cols(), 3);
    fixed.v.resize(3 * fields.cols());
    for (Index j = 0; j < fields.cols(); ++j) {
      const Vector3d delta = fields.col(j).segment<3>(3);
      for (int i = 0; i < 3; ++i) {
        const Vector3d q = Vector3d::Unit(i);
        fixed.M.block<3, 1>(3 * j, i) = P * (delta.cross(q) + fields(6, j) * q);
      }
      fixed.v.segment<3>(3 * j) = -P * fields.col(j).head<3>();
    }
    if (const Landmark* landmark = Nearest(fixed, nullptr)) {
      fixed.point = Relative(*landmark);
      if (IsAlone(*landmark)) fixed.landmark = landmark;
      return fixed;
    }
    SmallSvd svd;
    svd.Compute(fixed.M);
    fixed.point = svd.InversePowerTimes(1.0, kNegligible, fixed.v);
    if (!(fixed.DistanceTo(fixed.point) <= kNegligible)) return std::nullopt;
    return fixed;
  }

  // The landmark at a fixed point, and not where `other` is. Of several, the
  // first.
  const Landmark* Nearest(const FixedPoints& fixed,
                          const Landmark* other) const {
    constexpr double kRounding = 1e-9;
    const Landmark* nearest = nullptr;
    double least = kNegligible;
    for (const Landmark& landmark : landmarks_) {
      if (other != nullptr && AreClose(landmark, *other, 1e-3)) continue;
      const double distance = fixed.DistanceTo(Relative(landmark));
      if (distance < least - (nearest == nullptr ? 0.0 : kRounding)) {
        nearest = &landmark;
        least = distance;
      }
    }
    return nearest;
  }

  // Another block at the same place may be a revisit, or no point at all, such
  // as a bias of zero.
  bool IsAlone(const Landmark& landmark) const {
    return std::count_if(landmarks_.begin(),
                         landmarks_.end(),
                         [&](const Landmark& other) {
                           return AreClose(landmark, other, kNegligible);
                         }) == 1;
  }

  bool AreClose(const Landmark& a, const Landmark& b, double distance) const {
    return (a.position - b.position).norm() <= distance * length_;
  }

  void NameRotations(MatrixXd fields) {
    if (fields.cols() == 0) return;
    const MatrixXd deltas = fields.middleRows<3>(3);
    const ThinQr qr(deltas);
    const MatrixXd axes = UnitVectorsFirst(qr.Q);
    fields *= qr.R.triangularView<Eigen::Upper>().solve(
        MatrixXd(qr.Q.transpose() * axes));
    fields.middleRows<3>(3) = axes;
    const std::optional<FixedPoints> common = Find(fields);
    for (const auto field : fields.colwise()) {
      const std::optional<FixedPoints> fixed =
          common || fields.cols() == 1 ? common : Find(field);
      if (fixed) AddRotation(*fixed, field);
    }
  }

  void AddRotation(const FixedPoints& fixed, const MotionField& field) {
    const Vector3d axis = field.segment<3>(3);
    std::string name = "rotation";
    if (in_space_) name += " about " + Direction(axis, "");
    if (AllTranslate()) {
      Add(name, field);
      return;
    }
    const std::string point = PointName(fixed);
    if (!in_space_) {
      name += " about " + point;
    } else {
      name += " through " + point;
      // Two blocks say more than a direction.
      if (Axis(axis) < 0 && translations_.cols() == 0 && fixed.landmark) {
        const Landmark* second = Nearest(*Find(field), fixed.landmark);
        if (second != nullptr && IsAlone(*second)) {
          name = fmt::format("rotation about the axis through {} and {}",
                             point,
                             Name(*second));
        }
      }
    }
    Add(name, About(fixed.point, field));
  }

  void NameScale(const MatrixXd& fields) {
    if (fields.cols() == 0) return;
    const MotionField field = fields.col(0) / fields(6, 0);
    const std::optional<FixedPoints> fixed = Find(field);
    if (!fixed) return;
    if (AllTranslate()) {
      Add("scale", field);
    } else {
      Add("scale about " + PointName(*fixed), About(fixed->point, field));
    }
  }

  // Translated, so that the point rests.
  static MotionField About(const Vector3d& point, MotionField field) {
    const Vector3d delta = field.segment<3>(3);
    field.head<3>() = -delta.cross(point) - field[6] * point;
    return field;
  }

  void Add(const std::string& name, MotionField field) {
    field.head<3>() *= length_;
    named_.push_back({name, field});
  }

  bool AllTranslate() const {
    return translations_.cols() == (in_space_ ? 3 : 2);
  }

  Vector3d Relative(const Landmark& landmark) const {
    return (landmark.position - center_) / length_;
  }

  // "`pose 0`", "`x 0`, `y 0`", or the coordinates of constant blocks without
  // name.
  std::string Name(const Landmark& landmark) const {
    std::vector<std::string> names;
    for (const GaugeBlock* block : landmark.blocks) {
      if (block->name.empty()) {
        return "the constant block at " + Place(landmark.position);
      }
      names.push_back(fmt::format("`{}`", block->name));
    }
    return fmt::format("{}", fmt::join(names, ", "));
  }

  std::string PointName(const FixedPoints& fixed) const {
    return fixed.landmark != nullptr ? Name(*fixed.landmark)
                                     : Place(center_ + length_ * fixed.point);
  }

  std::string Place(const Vector3d& x) const {
    return Coordinates(Rounded(x / length_).head(in_space_ ? 3 : 2) * length_);
  }

  // "x", or "along (0.6, 0.8)".
  std::string Direction(const Vector3d& direction,
                        const std::string& along) const {
    const int axis = Axis(direction);
    if (axis >= 0) return std::string(1, "xyz"[axis]);
    return along + Coordinates(Rounded(direction).head(in_space_ ? 3 : 2));
  }

  static Vector3d Rounded(const Vector3d& x) {
    return (x.array().abs() < kNegligible).select(0.0, x);
  }

  const std::vector<Landmark>& landmarks_;
  const Vector3d center_;
  const bool in_space_;
  double length_ = 1.0;
  MatrixXd translations_;  // 3 x t, orthonormal
  std::vector<NamedField> named_;
};

}  // namespace

std::vector<NamedField> NameFields(const MatrixXd& fields,
                                   const std::vector<Landmark>& landmarks,
                                   const Vector3d& center,
                                   bool in_space) {
  return FieldNames(landmarks, center, in_space).Name(fields);
}

}  // namespace invgrad
