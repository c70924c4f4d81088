// The inverse problem of the heat equation: from a smoothed state to the
// initial state.
//
//   y = P(x): du/dt = nu laplace(u), periodic, u(0) = x, y = u(t)
//   L = 1/2 |y - y*|^2,   y* = P(x_gt)
//
//   heat         two dimensions; a network maps y* to x
//   heat_1d      the same in one
//   heat_state   two dimensions, no network: one x is sought, from x = 0
//
// Discretization: exact in time and in Fourier space
//          (spectral_diffusion.h). The box has the side 64 for any number n of
//          cells a side, dx = 64 / n, so nu_t = 8 is equally hard for all n: a
//          mode with m waves across the box decays by exp(-nu_t (2 pi
//          m / 64)^2) = exp(-0.077 m^2). n = 64 is the published problem. A
//          grid with n < 64 lacks the modes that decay most: the weakest mode
//          decays by 5e-5 at n = 16, by 1e-69 at n = 64.
// Shapes:  network input, x, y: n^2, row by row, or n in one dimension.
// Inverse: heat_inverse.h, local.
// Metric:  x_l1 = mean |x - x_gt|, over samples and cells; or metric=x_l1_cut, the
//          same for max(x, 0), as published; or metric=x_loss, the mean over the
//          samples of 1/2 |x - x_gt|^2. L is insensitive to most modes of x.
// Data:    random rectangles of heat; a cell holds the mean over its area:
//            x_gt = sum_{i < c} s_i 1[|r - p_i| <= h_i],   c = floor(4 + 7 U)
//            per axis p_i = 32 + 51.2 (U - 1/2), h_i = 10 U, then p_i is moved
//            so that the rectangle lies in the box;   s_i = U
//          with U from [0, 1), numpy's stream: for every state U for c; then,
//          for each of ten rectangles, of which c are used, p, h (one U an
//          axis, rows first) and s. In the release PhiFlow draws the numbers
//          and computes a cell's share in a rectangle from the distance of its
//          centre, for a new batch every step. So does
//          fresh_data here, where step k has the seed data_seed + 0x9e3779b9
//          (k + 1) mod 2^32. By default N states are drawn once,
//          and as many again for testing. x_gt is the data's solution.
//          heat_state takes the first of the states.
//          The means of y* and x_gt are equal: the U-net's output gets the mean
//          of its input.
// Settings: B 128, loss summed over the batch, Adam and SIP with step size 1e-3
//          for 6000 s, a U-net in single precision at n = 64
//          (network=u_net:fresh_data=true), padded periodically in the release
//          of 2022 and with zeros in PBDL's notebook. By default dense networks
//          with ReLU, n^2-128-128-n^2 (heat; 115,328 weights at n = 16) and
//          n-64-64-n (heat_1d).
// Facts:   x_gt minimizes L, with L = 0. In double precision, so does
//          every x that differs from x_gt only in modes with nu t |k|^2 > 36.
//          Published for heat, the sum of |x - x_gt| over 4096 cells, with the
//          network's mean corrected and negative values cut off: Adam 125.0,
//          SIP 50.4.
// Source:  Holl, Koltun, Thuerey, NeurIPS 2022, arXiv 2109.15048, and its code,
//          heat/ (generate_heat_example in inv_diffuse.py); PBDL, chapter physgrad-code.
#ifndef PROBLEMS_HEAT_H_
#define PROBLEMS_HEAT_H_

#include <cstdint>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/compare/sample_data.h"
#include "problems/field_data.h"
#include "problems/heat_inverse.h"
#include "problems/spectral_diffusion.h"

namespace invgrad {

// The options that the three problems have in common.
struct HeatPhysics {
  int resolution = 16;
  double nu_t = 8.0;
  HeatUncertainty uncertainty = {};
  void Describe(int max_resolution, OptionSet* set);

  // `rows`: of the grid, 1 or `resolution`.
  std::shared_ptr<const SpectralDiffusion> MakeSimulator(int rows) const;
};

// heat (kDimensions = 2) and heat_1d (1). `data`: states x_gt, one a row.
template <int kDimensions>
struct HeatNetwork {
  HeatPhysics physics = {kDimensions == 2 ? 16 : 64};
  int num_samples = 4096;
  int data_seed = 0;
  std::string metric = "x_l1";
  // Of heat only.
  FieldNetwork field;
  void Describe(OptionSet* set) {
    physics.Describe(kDimensions == 2 ? 64 : 1024, set);
    DescribeSamples(1, 1e6, &num_samples, &data_seed, set);
    set->Add("metric",
             &metric,
             {"x_l1", "x_l1_cut", "x_loss"},
             "the distance from x_gt");
    if (kDimensions == 1) return;
    field.Describe(set);
  }

  bool Create(LearningProblem* problem, std::string* error) const;
};

struct HeatState {
  HeatPhysics physics;
  int data_seed = 0;
  void Describe(OptionSet* set) {
    physics.Describe(256, set);
    set->Add("data_seed", &data_seed, {0, 2147483647}, "np.random.seed");
  }

  bool Create(PointProblem* problem, std::string* error) const;
};

// States x_gt: num_states x (rows cols). rows = 1 is one dimension.
Eigen::MatrixXd RandomHeatStates(int num_states,
                                 int rows,
                                 int cols,
                                 std::uint32_t seed);

}  // namespace invgrad

#endif  // PROBLEMS_HEAT_H_
