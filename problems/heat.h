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
// Metric:  x_l1 = mean |x - x_gt|. L is insensitive to most modes of x.
// Data:    random rectangles (heat_states.h). The release draws a new batch
//          every step. Here N states are drawn once, and as many again for
//          testing. x_gt is the data's solution. heat_state takes the first of
//          the states.
// Settings: B 128, loss summed over the batch, Adam and SIP with step size 1e-3
//          for 6000 s. Published is a U-net at n = 64; here dense networks with
//          ReLU, n^2-128-128-n^2 (heat; 115,328 weights at n = 16) and
//          n-64-64-n (heat_1d).
// Facts:   x_gt minimizes L, with L = 0. In double precision, so does
//          every x that differs from x_gt only in modes with nu t |k|^2 > 36.
//          Published for heat, the sum of |x - x_gt| over 4096 cells, with the
//          network's mean corrected and negative values cut off: Adam 125.0,
//          SIP 50.4.
// Source:  Holl, Koltun, Thuerey, NeurIPS 2022, arXiv 2109.15048, and its code,
//          heat/; PBDL, chapter physgrad-code.
#ifndef PROBLEMS_HEAT_H_
#define PROBLEMS_HEAT_H_

#include <string>

#include "Eigen/Core"
#include "problems/heat_inverse.h"
#include "problems/problem.h"
#include "problems/sample_data.h"

namespace invgrad {

// The physics' options, common to the three.
struct HeatPhysics {
  int resolution = 0;
  double nu_t = 8.0;
  HeatUncertainty uncertainty;
  void Describe(int max_resolution, OptionSet* set) {
    set->Add("resolution",
             &resolution,
             {2.0, 1.0 * max_resolution},
             "cells a side, n; the side is 64");
    set->Add("nu_t", &nu_t, {0.0, 1000.0}, "diffusivity x time");
    set->Add("relative_uncertainty",
             &uncertainty.relative,
             {0.0, 1.0},
             "of the inverse, per |y - P(x)| of a cell");
    set->Add("absolute_uncertainty",
             &uncertainty.absolute,
             {HeatUncertainty::kMinAbsolute, 1.0},
             "of the inverse, added to that");
  }
};

struct HeatLearningOptions {
  HeatPhysics physics;
  int num_samples = 4096;
  int data_seed = 0;
  void Describe(int max_resolution, OptionSet* set) {
    physics.Describe(max_resolution, set);
    DescribeSamples(1, 1e6, &num_samples, &data_seed, set);
  }
};

struct Heat {
  struct Options : HeatLearningOptions {
    Options() { physics.resolution = 16; }
    void Describe(OptionSet* set) { HeatLearningOptions::Describe(64, set); }
  };

  // `data`: states x_gt, one a row.
  static bool Create(const Options& options,
                     const Eigen::MatrixXd* data,
                     LearningProblem* problem,
                     std::string* error);
};

struct Heat1d {
  struct Options : HeatLearningOptions {
    Options() { physics.resolution = 64; }
    void Describe(OptionSet* set) { HeatLearningOptions::Describe(1024, set); }
  };

  // `data`: states x_gt, one a row.
  static bool Create(const Options& options,
                     const Eigen::MatrixXd* data,
                     LearningProblem* problem,
                     std::string* error);
};

struct HeatState {
  struct Options {
    HeatPhysics physics;
    int data_seed = 0;
    Options() { physics.resolution = 16; }
    void Describe(OptionSet* set) {
      physics.Describe(256, set);
      set->Add("data_seed", &data_seed, {0, 2147483647}, "np.random.seed");
    }
  };

  static bool Create(const Options& options,
                     PointProblem* problem,
                     std::string* error);
};

}  // namespace invgrad

#endif  // PROBLEMS_HEAT_H_
