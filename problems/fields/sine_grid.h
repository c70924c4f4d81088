// The sine transform on a grid whose fields are zero outside.
//
//   X_pq = c sum_ij x_ij sin(p pi (i + 1) / (rows + 1))
//                        sin(q pi (j + 1) / (cols + 1)),   p, q = 1, 2, ..
//   c = 2 / sqrt((rows + 1) (cols + 1))
//
// The transform is symmetric and orthogonal, so it is its own inverse. Its
// modes are the eigenvectors of the 5-point Laplacian with zero neighbours
// outside the grid:
//
//   lambda_pq = 2 cos(p pi / (rows + 1)) + 2 cos(q pi / (cols + 1)) - 4
//
// Shapes:  x, X: rows cols, row by row.
// Cost:    N log N for N = rows cols; fast where the prime factors of rows + 1
//          and cols + 1 are small.
// Fails:   never; a grid without cells is CHECKed.
//
// Threads, and reproducible bits: as FourierGrid.
#ifndef PROBLEMS_FIELDS_SINE_GRID_H_
#define PROBLEMS_FIELDS_SINE_GRID_H_

#include <memory>

#include "Eigen/Core"

struct fftw_plan_s;

namespace invgrad {

class SineGrid {
 public:
  SineGrid(int rows, int cols);

  int rows() const { return rows_; }
  int cols() const { return cols_; }
  int num_cells() const { return rows_ * cols_; }

  // lambda of every mode.
  Eigen::ArrayXd LaplacianEigenvalues() const;

  // The arrays do not overlap.
  void Transform(const double* x, double* X) const;

 private:
  int rows_;
  int cols_;
  std::shared_ptr<fftw_plan_s> plan_;
};

}  // namespace invgrad

#endif  // PROBLEMS_FIELDS_SINE_GRID_H_
