// The heat equation on a periodic grid, exact in time.
//
//   y = P(x) = F^-1(exp(-nu t |k|^2) F(x)),   J = P,   J^T = P
//
// with the discrete Fourier transform F (fields/fourier_grid.h).
//
// Shapes:  x, y: N = rows cols cells, row by row. One dimension is rows = 1.
// Units:   cells have the length 1: `diffusion` is nu t in cells^2: divide a
//          nu t in units of length by dx^2.
// Cost:    a filter is two transforms of N log N; J is a circulant matrix, one
//          filter and N^2 copies (fields/diagonal_simulator.h).
// Facts:   P is linear, symmetric and positive; the mean is conserved, |y| <=
//          |x|; P of nu t twice is P of 2 nu t. Modes with nu t |k|^2 > 36 do
//          not reach y in double precision: the inverse is heat_inverse.h.
// Fails:   returns false if y is not finite. A grid without cells, and a
//          diffusion that is negative or not finite, are CHECKed.
#ifndef PROBLEMS_SPECTRAL_DIFFUSION_H_
#define PROBLEMS_SPECTRAL_DIFFUSION_H_

#include <memory>

#include "Eigen/Core"
#include "problems/fields/diagonal_simulator.h"
#include "problems/fields/fourier_grid.h"

namespace invgrad {

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
