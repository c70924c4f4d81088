#include "problems/spectral_diffusion.h"

#include <cmath>
#include <complex>
#include <utility>

#include "glog/logging.h"
#include "invgrad/internal/scratch.h"

namespace invgrad {

namespace {

// nu t |k|^2 of every mode.
Eigen::ArrayXd Exponents(const FourierGrid& grid, double diffusion) {
  CHECK(diffusion >= 0.0 && std::isfinite(diffusion)) << "nu t = " << diffusion;
  return diffusion * grid.SquaredWaveNumbers();
}

}  // namespace

SpectralDiffusion::SpectralDiffusion(std::shared_ptr<const FourierGrid> grid,
                                     double diffusion)
    : DiagonalSimulator(grid->num_cells(),
                        (-Exponents(*grid, diffusion)).exp()),
      grid_(std::move(grid)),
      exponents_(Exponents(*grid_, diffusion)) {}

void SpectralDiffusion::Filter(const Eigen::ArrayXd& factors,
                               const double* x,
                               double* y) const {
  Scratch<std::complex<double>> modes(grid_->num_modes());
  grid_->Forward(x, modes.data());
  Eigen::Map<Eigen::ArrayXcd>(modes.data(), grid_->num_modes()) *= factors;
  grid_->Backward(modes.data(), y);
}

void SpectralDiffusion::FormJacobian(double* jacobian) const {
  // The response to heat in cell (0, 0), shifted to every other cell.
  const int rows = grid_->rows();
  const int cols = grid_->cols();
  const Eigen::VectorXd impulse = Eigen::VectorXd::Unit(num_inputs(), 0);
  Eigen::VectorXd response(num_inputs());
  Filter(decay(), impulse.data(), response.data());
  double* entry = jacobian;
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < cols; ++j) {
      for (int p = 0; p < rows; ++p) {
        const double* row = response.data() + (i - p + rows) % rows * cols;
        for (int q = 0; q < cols; ++q) *entry++ = row[(j - q + cols) % cols];
      }
    }
  }
}

}  // namespace invgrad
