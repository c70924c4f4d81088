#include "problems/spectral_diffusion.h"

#include <fftw3.h>

#include <cmath>
#include <mutex>
#include <utility>
#include <vector>

#include "glog/logging.h"
#include "invgrad/core/scratch.h"
#include "problems/fields/fftw_planner.h"

namespace invgrad {

namespace {

fftw_complex* AsFftw(std::complex<double>* modes) {
  return reinterpret_cast<fftw_complex*>(modes);
}

// 2 pi m / n for the index of an unsorted transform.
double WaveNumber(int index, int n) {
  const int m = 2 * index < n ? index : index - n;
  return 2.0 * M_PI * m / n;
}

}  // namespace

FourierGrid::FourierGrid(int rows, int cols) : rows_(rows), cols_(cols) {
  CHECK_GT(rows, 0);
  CHECK_GT(cols, 0);
  std::vector<double> x(num_cells());
  std::vector<std::complex<double>> modes(num_modes());
  fftw_complex* const X = AsFftw(modes.data());
  const unsigned flags = FFTW_ESTIMATE | FFTW_UNALIGNED;
  const std::lock_guard<std::mutex> lock(FftwPlannerMutex());
  forward_ = SharePlan(fftw_plan_dft_r2c_2d(rows, cols, x.data(), X, flags));
  backward_ = SharePlan(fftw_plan_dft_c2r_2d(rows, cols, X, x.data(), flags));
}

Eigen::ArrayXd FourierGrid::SquaredWaveNumbers() const {
  Eigen::ArrayXd squares(num_modes());
  int mode = 0;
  for (int i = 0; i < rows_; ++i) {
    for (int j = 0; j <= cols_ / 2; ++j) {
      squares[mode++] =
          std::pow(WaveNumber(i, rows_), 2) + std::pow(WaveNumber(j, cols_), 2);
    }
  }
  return squares;
}

void FourierGrid::Forward(const double* x, std::complex<double>* modes) const {
  // An out-of-place transform does not write its input, except the one from
  // complex to real numbers.
  fftw_execute_dft_r2c(forward_.get(), const_cast<double*>(x), AsFftw(modes));
}

void FourierGrid::Backward(std::complex<double>* modes, double* x) const {
  fftw_execute_dft_c2r(backward_.get(), AsFftw(modes), x);
  Eigen::Map<Eigen::ArrayXd>(x, num_cells()) /= num_cells();
}

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
