// Advection of a field by one look-up along the velocity, and its derivatives.
//
//   semi-Lagrangian:  y(p) = f(p - d(p))
//   MacCormack:       b(p) = f(p - d(p)),  c(p) = b(p + d(p)),
//                     y = b + (f - c) / 2, clamped to the least and the
//                     greatest of the four values of f around p - d(p)
//
// with f(.) interpolated linearly along both axes.
//
// Shapes:  f, y: a value a point of the lattice, row by row (N); d: 2 N, first
//          all displacements along a row (x), then all along a column (y).
//          One dimension is a lattice of one row.
// Units:   points of the lattice are 1 apart, d = v dt / dx.
// Derivative: with respect to f and to d, through the interpolation; where y is
//          clamped, that of the value that it is clamped to. It jumps where a
//          look-up meets a point of the lattice and where the clamp begins to
//          act: there it is the one to the right.
// Cost:    some 50 (semi-Lagrangian) or 120 (MacCormack) operations a point;
//          the object keeps 56 or 108 bytes a point; a product costs less than
//          the value.
// Facts:   order 1 (semi-Lagrangian) or 2 (MacCormack, where it is not
//          clamped) in cells; y lies between the least and the greatest f.
//          Stable for any d.
// Fails:   values that are not finite give results that are not finite.
//
// Source:  Selle, Fedkiw, Kim, Liu, Rossignac. An unconditionally stable
//          MacCormack method. J. Sci. Comput. 35, 2008; PhiFlow, advect.
#ifndef PROBLEMS_FIELDS_ADVECTION_H_
#define PROBLEMS_FIELDS_ADVECTION_H_

#include <array>
#include <vector>

#include "Eigen/Core"

namespace invgrad {

struct Lattice {
  // The value outside: that of the periodic field, of the nearest point, or 0.
  enum class Outside { kPeriodic, kNearest, kZero };

  int rows = 0;
  int cols = 0;
  Outside outside = Outside::kPeriodic;

  int size() const { return rows * cols; }
};

// The values of a field at p + sign d(p).
class Lookup {
 public:
  Lookup(const Lattice& lattice, const Eigen::VectorXd& d, double sign);

  // Also keeps the slopes of f, which the products use.
  Eigen::VectorXd Interpolate(const Eigen::VectorXd& f);

  Eigen::VectorXd Tangent(const Eigen::VectorXd& df,
                          const Eigen::VectorXd& dd) const;
  // Adds to *f_bar and *d_bar.
  void Adjoint(const Eigen::VectorXd& out_bar,
               Eigen::VectorXd* f_bar,
               Eigen::VectorXd* d_bar) const;

  // The four points around p + sign d(p); kNone: outside, with the value 0.
  static constexpr int kNone = -1;
  const std::array<int, 4>& corners(int point) const { return corners_[point]; }

 private:
  std::array<double, 4> Weights(int point) const;

  double sign_;
  std::vector<std::array<int, 4>> corners_;
  Eigen::VectorXd x_, y_;              // the position between the corners
  Eigen::VectorXd x_slope_, y_slope_;  // df/dx, df/dy there
};

class AdvectedField {
 public:
  enum class Scheme { kSemiLagrangian, kMacCormack };

  AdvectedField(const Lattice& lattice,
                Scheme scheme,
                const Eigen::VectorXd& f,
                const Eigen::VectorXd& d);

  const Eigen::VectorXd& value() const { return value_; }

  Eigen::VectorXd Tangent(const Eigen::VectorXd& df,
                          const Eigen::VectorXd& dd) const;
  // Adds to *f_bar and *d_bar.
  void Adjoint(Eigen::VectorXd value_bar,
               Eigen::VectorXd* f_bar,
               Eigen::VectorXd* d_bar) const;

 private:
  // The value of clamped_to_: y is not clamped.
  static constexpr int kFree = -2;

  Lookup backward_;
  // MacCormack only: the look-up of b, and the point that each y is clamped to.
  std::vector<Lookup> forward_;
  std::vector<int> clamped_to_;
  Eigen::VectorXd value_;
};

}  // namespace invgrad

#endif  // PROBLEMS_FIELDS_ADVECTION_H_
