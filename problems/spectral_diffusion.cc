#include "problems/spectral_diffusion.h"

#include <fftw3.h>

#include <cmath>
#include <mutex>
#include <utility>
#include <vector>

#include "glog/logging.h"
#include "invgrad/core/scratch.h"

namespace invgrad {

namespace {

// FFTW can execute plans in parallel, but not create or destroy them.
std::mutex& PlannerMutex() {
  static auto& mutex = *new std::mutex;
  return mutex;
}

std::shared_ptr<fftw_plan_s> Share(fftw_plan plan) {
  return {plan, [](fftw_plan unused) {
            const std::lock_guard<std::mutex> lock(PlannerMutex());
            fftw_destroy_plan(unused);
          }};
}

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
  const std::lock_guard<std::mutex> lock(PlannerMutex());
  forward_ = Share(fftw_plan_dft_r2c_2d(rows, cols, x.data(), X, flags));
  backward_ = Share(fftw_plan_dft_c2r_2d(rows, cols, X, x.data(), flags));
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

SpectralDiffusion::SpectralDiffusion(std::shared_ptr<const FourierGrid> grid,
                                     double diffusion)
    : grid_(std::move(grid)) {
  CHECK(diffusion >= 0.0 && std::isfinite(diffusion)) << "nu t = " << diffusion;
  exponents_ = diffusion * grid_->SquaredWaveNumbers();
  decay_ = (-exponents_).exp();
}

bool SpectralDiffusion::Evaluate(const double* x,
                                 const double* /*context*/,
                                 double* y,
                                 double* jacobian) const {
  if (!Diffuse(x, y)) return false;
  if (jacobian == nullptr) return true;
  // The response to heat in cell (0, 0), shifted to every other cell.
  const int rows = grid_->rows();
  const int cols = grid_->cols();
  const Eigen::VectorXd impulse = Eigen::VectorXd::Unit(num_inputs(), 0);
  Eigen::VectorXd response(num_inputs());
  if (!Diffuse(impulse.data(), response.data())) return false;
  double* entry = jacobian;
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < cols; ++j) {
      for (int p = 0; p < rows; ++p) {
        const double* row = response.data() + (i - p + rows) % rows * cols;
        for (int q = 0; q < cols; ++q) *entry++ = row[(j - q + cols) % cols];
      }
    }
  }
  return true;
}

bool SpectralDiffusion::Adjoint(const double* x,
                                const double* /*context*/,
                                const Covector& covector,
                                double* y,
                                double* x_bar) const {
  if (!Diffuse(x, y)) return false;
  Scratch<double> w(num_outputs());
  return covector(y, w.data()) && Diffuse(w.data(), x_bar);
}

bool SpectralDiffusion::WeightedHessian(const double* /*x*/,
                                        const double* /*context*/,
                                        const double* /*w*/,
                                        double* hessian) const {
  Eigen::Map<Eigen::MatrixXd>(hessian, num_inputs(), num_inputs()).setZero();
  return true;
}

bool SpectralDiffusion::Diffuse(const double* x, double* y) const {
  Scratch<std::complex<double>> modes(grid_->num_modes());
  grid_->Forward(x, modes.data());
  Eigen::Map<Eigen::ArrayXcd>(modes.data(), grid_->num_modes()) *= decay_;
  grid_->Backward(modes.data(), y);
  return AllFinite(y, num_outputs());
}

}  // namespace invgrad
