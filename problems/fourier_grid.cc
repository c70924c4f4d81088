#include "problems/fourier_grid.h"

#include <fftw3.h>

#include <cmath>
#include <mutex>
#include <vector>

#include "glog/logging.h"

namespace invgrad {

namespace {

// FFTW can execute plans in parallel, but not create or destroy them.
std::mutex& PlannerMutex() {
  static auto& mutex = *new std::mutex;
  return mutex;
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

struct FourierGrid::Plans {
  Plans(int rows, int cols) {
    std::vector<double> x(static_cast<size_t>(rows) * cols);
    std::vector<std::complex<double>> modes(static_cast<size_t>(rows) *
                                            (cols / 2 + 1));
    const unsigned flags = FFTW_ESTIMATE | FFTW_UNALIGNED;
    const std::lock_guard<std::mutex> lock(PlannerMutex());
    forward =
        fftw_plan_dft_r2c_2d(rows, cols, x.data(), AsFftw(modes.data()), flags);
    backward =
        fftw_plan_dft_c2r_2d(rows, cols, AsFftw(modes.data()), x.data(), flags);
  }
  ~Plans() {
    const std::lock_guard<std::mutex> lock(PlannerMutex());
    fftw_destroy_plan(forward);
    fftw_destroy_plan(backward);
  }
  Plans(const Plans&) = delete;
  Plans& operator=(const Plans&) = delete;

  fftw_plan forward;
  fftw_plan backward;
};

FourierGrid::FourierGrid(int rows, int cols) : rows_(rows), cols_(cols) {
  CHECK_GT(rows, 0);
  CHECK_GT(cols, 0);
  plans_ = std::make_unique<const Plans>(rows, cols);
  squared_wave_numbers_.resize(num_modes());
  int mode = 0;
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j <= cols / 2; ++j) {
      squared_wave_numbers_[mode++] =
          std::pow(WaveNumber(i, rows), 2) + std::pow(WaveNumber(j, cols), 2);
    }
  }
}

FourierGrid::~FourierGrid() = default;

void FourierGrid::Forward(const double* x, std::complex<double>* modes) const {
  // An out-of-place transform does not write its input, except the one from
  // complex to real numbers.
  fftw_execute_dft_r2c(plans_->forward, const_cast<double*>(x), AsFftw(modes));
}

void FourierGrid::Backward(std::complex<double>* modes, double* x) const {
  fftw_execute_dft_c2r(plans_->backward, AsFftw(modes), x);
  Eigen::Map<Eigen::ArrayXd>(x, num_cells()) /= num_cells();
}

}  // namespace invgrad
