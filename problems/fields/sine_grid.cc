#include "problems/fields/sine_grid.h"

#include <fftw3.h>

#include <cmath>
#include <mutex>
#include <vector>

#include "glog/logging.h"
#include "problems/fields/fftw_planner.h"

namespace invgrad {

SineGrid::SineGrid(int rows, int cols) : rows_(rows), cols_(cols) {
  CHECK_GT(rows, 0);
  CHECK_GT(cols, 0);
  std::vector<double> x(num_cells());
  std::vector<double> X(num_cells());
  const std::lock_guard<std::mutex> lock(FftwPlannerMutex());
  plan_ = SharePlan(fftw_plan_r2r_2d(rows,
                                     cols,
                                     x.data(),
                                     X.data(),
                                     FFTW_RODFT00,
                                     FFTW_RODFT00,
                                     FFTW_ESTIMATE | FFTW_UNALIGNED));
}

Eigen::ArrayXd SineGrid::LaplacianEigenvalues() const {
  Eigen::ArrayXd eigenvalues(num_cells());
  for (int p = 0; p < rows_; ++p) {
    for (int q = 0; q < cols_; ++q) {
      eigenvalues[cols_ * p + q] =
          2.0 * std::cos(M_PI * (p + 1) / (rows_ + 1)) +
          2.0 * std::cos(M_PI * (q + 1) / (cols_ + 1)) - 4.0;
    }
  }
  return eigenvalues;
}

void SineGrid::Transform(const double* x, double* X) const {
  // A transform between real arrays does not write its input.
  fftw_execute_r2r(plan_.get(), const_cast<double*>(x), X);
  // FFTW's sum has the factor 2 for each axis.
  Eigen::Map<Eigen::ArrayXd>(X, num_cells()) /=
      2.0 * std::sqrt((rows_ + 1.0) * (cols_ + 1.0));
}

}  // namespace invgrad
