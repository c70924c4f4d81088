// Fourier and cosine transforms of fields on a grid, by FFTW.
//
//   FourierGrid, a periodic box:
//     X_k = sum_j x_j exp(-i k . j),   x_j = 1/N sum_k X_k exp(i k . j)
//     k = 2 pi (m_0 / rows, m_1 / cols),   -n/2 <= m < n/2 on a side of n cells
//   CosineGrid, a box with walls, across which a field is mirrored:
//     X_k = 4 sum_j x_j cos(k_0 (j_0 + 1/2)) cos(k_1 (j_1 + 1/2))
//     k = pi (m_0 / rows, m_1 / cols),   0 <= m < n
//
// Shapes:  x: N = rows cols cells, row by row. FourierGrid: X: num_modes() =
//          rows (cols / 2 + 1), the half with m_1 >= 0, row by row; the other
//          half is conjugate. CosineGrid: X: N. One dimension is rows = 1.
// Units:   cells have the length 1: k is in radians a cell.
// Cost:    N log N.
// Fails:   never; a grid without cells is CHECKed.
//
// Several threads may share the objects. The transforms do not depend on
// timings or the alignment of arrays (FFTW_ESTIMATE, FFTW_UNALIGNED), so
// results on one machine are reproducible bit for bit.
//
// Source: Frigo, Johnson. The Design and Implementation of FFTW3. Proceedings
//         of the IEEE 93 (2), 2005.
#ifndef PROBLEMS_FIELDS_FOURIER_GRID_H_
#define PROBLEMS_FIELDS_FOURIER_GRID_H_

#include <complex>
#include <memory>

#include "Eigen/Core"

struct fftw_plan_s;

namespace invgrad {

class FourierGrid {
 public:
  FourierGrid(int rows, int cols);

  int rows() const { return rows_; }
  int cols() const { return cols_; }
  int num_cells() const { return rows_ * cols_; }
  int num_modes() const { return rows_ * (cols_ / 2 + 1); }

  // |k|^2 of every mode.
  Eigen::ArrayXd SquaredWaveNumbers() const;

  void Forward(const double* x, std::complex<double>* modes) const;

  // Overwrites `modes`.
  void Backward(std::complex<double>* modes, double* x) const;

 private:
  int rows_;
  int cols_;
  std::shared_ptr<fftw_plan_s> forward_;
  std::shared_ptr<fftw_plan_s> backward_;
};

class CosineGrid {
 public:
  CosineGrid(int rows, int cols);

  int rows() const { return rows_; }
  int cols() const { return cols_; }

  void Forward(const double* x, double* modes) const;
  void Backward(const double* modes, double* x) const;

 private:
  int rows_;
  int cols_;
  std::shared_ptr<fftw_plan_s> forward_;
  std::shared_ptr<fftw_plan_s> backward_;
};

}  // namespace invgrad

#endif  // PROBLEMS_FIELDS_FOURIER_GRID_H_
