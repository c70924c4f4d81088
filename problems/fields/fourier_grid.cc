#include "problems/fields/fourier_grid.h"

#include <fftw3.h>

#include <cmath>
#include <mutex>
#include <vector>

#include "glog/logging.h"
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

constexpr unsigned kFlags = FFTW_ESTIMATE | FFTW_UNALIGNED;

}  // namespace

FourierGrid::FourierGrid(int rows, int cols) : rows_(rows), cols_(cols) {
  CHECK_GT(rows, 0);
  CHECK_GT(cols, 0);
  std::vector<double> x(num_cells());
  std::vector<std::complex<double>> modes(num_modes());
  fftw_complex* const X = AsFftw(modes.data());
  const std::lock_guard<std::mutex> lock(FftwPlannerMutex());
  forward_ = SharePlan(fftw_plan_dft_r2c_2d(rows, cols, x.data(), X, kFlags));
  backward_ = SharePlan(fftw_plan_dft_c2r_2d(rows, cols, X, x.data(), kFlags));
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

CosineGrid::CosineGrid(int rows, int cols) : rows_(rows), cols_(cols) {
  CHECK_GT(rows, 0);
  CHECK_GT(cols, 0);
  std::vector<double> x(rows * cols);
  std::vector<double> modes(rows * cols);
  const auto plan = [&](fftw_r2r_kind kind) {
    return SharePlan(fftw_plan_r2r_2d(
        rows, cols, x.data(), modes.data(), kind, kind, kFlags));
  };
  const std::lock_guard<std::mutex> lock(FftwPlannerMutex());
  forward_ = plan(FFTW_REDFT10);
  backward_ = plan(FFTW_REDFT01);
}

void CosineGrid::Forward(const double* x, double* modes) const {
  fftw_execute_r2r(forward_.get(), const_cast<double*>(x), modes);
}

void CosineGrid::Backward(const double* modes, double* x) const {
  fftw_execute_r2r(backward_.get(), const_cast<double*>(modes), x);
  Eigen::Map<Eigen::ArrayXd>(x, rows_ * cols_) /= 4.0 * rows_ * cols_;
}

}  // namespace invgrad
