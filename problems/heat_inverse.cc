#include "problems/heat_inverse.h"

#include <cmath>
#include <complex>
#include <utility>

#include "glog/logging.h"
#include "invgrad/internal/scratch.h"

namespace invgrad {

HeatInverse::HeatInverse(std::shared_ptr<const SpectralDiffusion> simulator,
                         const HeatUncertainty& uncertainty)
    : simulator_(std::move(simulator)), uncertainty_(uncertainty) {
  CHECK_GE(uncertainty_.absolute, HeatUncertainty::kMinAbsolute);
  CHECK_GE(uncertainty_.relative, 0.0);
}

bool HeatInverse::Invert(const ConstVectorRef& y,
                         const ConstVectorRef& x0,
                         const ConstVectorRef& /*context*/,
                         Eigen::VectorXd* x,
                         std::string* why) const {
  const FourierGrid& grid = simulator_->grid();
  CHECK_EQ(y.size(), grid.num_cells());
  CHECK_EQ(x0.size(), grid.num_cells());
  Scratch<double> difference(grid.num_cells());
  Eigen::Map<Eigen::ArrayXd> dy(difference.data(), grid.num_cells());
  if (!simulator_->Evaluate(x0.data(), nullptr, dy.data(), nullptr)) {
    *why = "the simulator has no finite value at x0";
    return false;
  }
  dy = y.array() - dy;
  if (!dy.allFinite()) {
    *why = "the target is not finite";
    return false;
  }
  const double u =
      std::sqrt((uncertainty_.relative * dy.abs() + uncertainty_.absolute)
                    .square()
                    .sum());
  Scratch<std::complex<double>> modes(grid.num_modes());
  grid.Forward(dy.data(), modes.data());
  const double root_of_cells = std::sqrt(grid.num_cells());
  for (int k = 0; k < grid.num_modes(); ++k) {
    const double expected = root_of_cells * simulator_->decay()[k];
    const double action = Action(std::sqrt(std::norm(modes[k])), expected, u);
    modes[k] *= std::exp(action * simulator_->exponents()[k]);
  }
  x->resize(grid.num_cells());
  grid.Backward(modes.data(), x->data());
  *x += x0;
  return true;
}

double HeatInverse::Action(double amplitude,
                           double expected,
                           double uncertainty) {
  if (amplitude == 0.0) return 0.0;  // 0 inf where nothing is expected
  // log(s_k / n_k) = 1/2 |D_k|^2 (1 / u^2 - 1 / e_k^2), without squares: they
  // may underflow, and 0 inf and inf - inf are NaN.
  const double per_u = 1.0 / uncertainty;
  const double per_e = 1.0 / expected;
  const double log_odds =
      0.5 * (amplitude * (per_u - per_e)) * (amplitude * (per_u + per_e));
  const double probability = 1.0 / (1.0 + std::exp(-log_odds));
  return probability > 0.5 && probability < 0.68 ? 0.0
                                                 : 2.0 * probability - 1.0;
}

}  // namespace invgrad
