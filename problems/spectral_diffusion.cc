#include "problems/spectral_diffusion.h"

#include <cmath>
#include <utility>

#include "glog/logging.h"
#include "invgrad/core/scratch.h"

namespace invgrad {

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
