// A velocity on a grid of cells: where its components are, how they reach other
// places, and its pressure projection.
//
//   P u = u - G (D G)^-1 D u,   D: divergence,   G = -D^T: gradient
//
//   kFaces    staggered: u_x on the faces between the cells of a row, u_y on
//             those of a column. D: the differences over a cell; D G: the
//             five-point Laplacian. In a periodic box face j lies on the low
//             side of cell j; in a closed box the faces on the walls are not
//             stored: the velocity there, and outside, is 0.
//   kCentres  u_x and u_y in the centres of the cells, periodic. D: central
//             differences; D G: the five-point Laplacian of every second cell,
//             which does not constrain the modes with wave lengths of two cells.
//
// Shapes:  N = rows cols cells, row by row; u: size(), first u_x, then u_y;
//          x runs along a row and y along a column.
//          kCentres and periodic kFaces: 2 N; closed kFaces: rows (cols - 1) +
//          (rows - 1) cols.
// Units:   cells have the length 1.
// Maps:    linear means of the neighbours, as sparse matrices A: tangent A v,
//          adjoint A^T w.
// Cost:    P: 6 |u| operations and two Fourier (periodic) or cosine (closed)
//          transforms: exact, no iteration.
// Facts:   P is symmetric, P P = P, D P u = 0, the mean of a periodic u stays.
// Fails:   a grid without faces is CHECKed.
#ifndef PROBLEMS_FIELDS_VELOCITY_GRID_H_
#define PROBLEMS_FIELDS_VELOCITY_GRID_H_

#include <array>
#include <optional>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "problems/fields/advection.h"
#include "problems/fields/fourier_grid.h"

namespace invgrad {

class VelocityGrid {
 public:
  enum class Place { kFaces, kCentres };
  enum class Box { kPeriodic, kClosed };
  using Map = Eigen::SparseMatrix<double, Eigen::RowMajor>;

  // A closed box has faces only (CHECKed).
  VelocityGrid(int rows, int cols, Place place, Box box);

  int num_cells() const { return cells_.size(); }
  int size() const { return components_[0].size() + components_[1].size(); }

  // The points of the cells (values outside: the nearest) and of u_x and u_y.
  const Lattice& cells() const { return cells_; }
  const Lattice& component(int c) const { return components_[c]; }
  // u_x (c = 0) or u_y (c = 1) of u.
  Eigen::VectorXd Component(const Eigen::VectorXd& u, int c) const;
  Eigen::VectorBlock<Eigen::VectorXd> Part(Eigen::VectorXd* u, int c) const;

  // u, both components, in the centres of the cells: 2 N x |u|; at the points
  // of component c: 2 N_c x |u|.
  const Map& to_cells() const { return to_cells_; }
  const Map& to_component(int c) const { return to_component_[c]; }
  // Both components in the centres of the cells (2 N) to u: |u| x 2 N.
  const Map& from_cells() const { return from_cells_; }
  // D: N x |u|.
  const Map& divergence() const { return divergence_; }

  // P u; also the tangent and the adjoint of P.
  Eigen::VectorXd Project(const Eigen::VectorXd& u) const;

 private:
  int Face(int c, int i, int j) const;
  void FillInverseLaplace(bool has_faces);

  Box box_;
  Lattice cells_;
  std::array<Lattice, 2> components_;
  Map to_cells_;
  std::array<Map, 2> to_component_;
  Map from_cells_;
  Map divergence_;
  std::optional<FourierGrid> fourier_;
  std::optional<CosineGrid> cosine_;
  Eigen::ArrayXd inverse_laplace_;  // of every mode; 0 for 1 / 0
};

}  // namespace invgrad

#endif  // PROBLEMS_FIELDS_VELOCITY_GRID_H_
