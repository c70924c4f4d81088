// The heat equation on a periodic grid, exact in time.
//
//   y = P(x) = F^-1(exp(-nu t |k|^2) F(x)),   J = P,   J^T = P
//
// with the discrete Fourier transform F,
//
//   X_k = sum_j x_j exp(-i k . j),   x_j = 1/N sum_k X_k exp(i k . j)
//   k = 2 pi (m_0 / rows, m_1 / cols),   -n/2 <= m < n/2 on a side of n cells
//
// Shapes:  x, y: N = rows cols cells, row by row; X: num_modes() = rows
//          (cols / 2 + 1), the half with m_1 >= 0, row by row; the other half
//          is conjugate. One dimension is rows = 1.
// Units:   cells have the length 1: k is in radians a cell, and `diffusion` is
//          nu t in cells^2: divide a nu t in units of length by dx^2.
// Cost:    a filter is two transforms of N log N; J is a circulant matrix, one
//          filter and N^2 copies (fields/diagonal_simulator.h).
// Facts:   P is linear, symmetric and positive; the mean is conserved, |y| <=
//          |x|; P of nu t twice is P of 2 nu t. Modes with nu t |k|^2 > 36 do
//          not reach y in double precision: the inverse is heat_inverse.h.
// Fails:   returns false if y is not finite. A grid without cells, and a
//          diffusion that is negative or not finite, are CHECKed.
//
// Several threads may share the objects. The transform does not depend on
// timings or the alignment of arrays (FFTW_ESTIMATE, FFTW_UNALIGNED), so
// results on one machine are reproducible bit for bit.
//
// Source: Frigo, Johnson. The Design and Implementation of FFTW3. Proceedings
//         of the IEEE 93 (2), 2005.
#ifndef PROBLEMS_SPECTRAL_DIFFUSION_H_
#define PROBLEMS_SPECTRAL_DIFFUSION_H_

#include <complex>
#include <memory>

#include "Eigen/Core"
#include "problems/fields/diagonal_simulator.h"

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

class SpectralDiffusion final : public DiagonalSimulator {
 public:
  SpectralDiffusion(std::shared_ptr<const FourierGrid> grid, double diffusion);

  const FourierGrid& grid() const { return *grid_; }
  // nu t |k|^2 of every mode.
  const Eigen::ArrayXd& exponents() const { return exponents_; }
  // exp(-nu t |k|^2) of every mode.
  const Eigen::ArrayXd& decay() const { return eigenvalues(); }

 private:
  void Filter(const Eigen::ArrayXd& factors,
              const double* x,
              double* y) const override;
  void FormJacobian(double* jacobian) const override;

  std::shared_ptr<const FourierGrid> grid_;
  Eigen::ArrayXd exponents_;
};

}  // namespace invgrad

#endif  // PROBLEMS_SPECTRAL_DIFFUSION_H_
