// A periodic grid and its discrete Fourier transform.
//
//   X_k = sum_j x_j exp(-i k . j),   x_j = 1/N sum_k X_k exp(i k . j)
//   k = 2 pi (m_0 / rows, m_1 / cols),   -n/2 <= m < n/2 on a side of n cells
//
// Shapes:  x: N = rows cols cells, row by row; X: num_modes() = rows
//          (cols / 2 + 1), the half with m_1 >= 0, row by row; the other half
//          is conjugate. One dimension is rows = 1.
// Units:   cells have the length 1: k is in radians a cell.
// Cost:    N log N a transform; the constructor makes the plans.
// Fails:   a grid without cells is CHECKed.
//
// Several threads may share a grid. The algorithm does not depend on timings or
// the alignment of arrays (FFTW_ESTIMATE, FFTW_UNALIGNED), so results on one
// machine are reproducible bit for bit.
//
// Source: Frigo, Johnson. The Design and Implementation of FFTW3. Proceedings
//         of the IEEE 93 (2), 2005.
#ifndef PROBLEMS_FOURIER_GRID_H_
#define PROBLEMS_FOURIER_GRID_H_

#include <complex>
#include <memory>

#include "Eigen/Core"

namespace invgrad {

class FourierGrid {
 public:
  FourierGrid(int rows, int cols);
  ~FourierGrid();
  FourierGrid(const FourierGrid&) = delete;
  FourierGrid& operator=(const FourierGrid&) = delete;

  int rows() const { return rows_; }
  int cols() const { return cols_; }
  int num_cells() const { return rows_ * cols_; }
  int num_modes() const { return rows_ * (cols_ / 2 + 1); }

  // |k|^2 of every mode.
  const Eigen::ArrayXd& squared_wave_numbers() const {
    return squared_wave_numbers_;
  }

  void Forward(const double* x, std::complex<double>* modes) const;

  // Overwrites `modes`.
  void Backward(std::complex<double>* modes, double* x) const;

 private:
  struct Plans;

  int rows_;
  int cols_;
  Eigen::ArrayXd squared_wave_numbers_;
  std::unique_ptr<const Plans> plans_;
};

}  // namespace invgrad

#endif  // PROBLEMS_FOURIER_GRID_H_
