#include "problems/heat.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "fmt/core.h"
#include "invgrad/loss.h"
#include "invgrad/random.h"

namespace invgrad {

namespace {

constexpr double kBoxSide = 64.0;
constexpr int kMaxRectangles = 10;

// The share of each of n cells that lies in [low, high].
Eigen::VectorXd Shares(int n, double low, double high) {
  const double dx = kBoxSide / n;
  Eigen::VectorXd shares(n);
  for (int i = 0; i < n; ++i) {
    const double overlap = std::min(high, (i + 1) * dx) - std::max(low, i * dx);
    shares[i] = std::max(overlap, 0.0) / dx;
  }
  return shares;
}

// The shares along one axis of the rectangle with the numbers U of p and h.
Eigen::VectorXd RandomShares(int n, double u_position, double u_half_size) {
  const double half_size = 10.0 * u_half_size;
  const double position = kBoxSide / 2.0 + 0.8 * kBoxSide * (u_position - 0.5);
  const double centre = std::clamp(position, half_size, kBoxSide - half_size);
  return Shares(n, centre - half_size, centre + half_size);
}

}  // namespace

void HeatPhysics::Describe(int max_resolution, OptionSet* set) {
  set->Add("resolution",
           &resolution,
           {2.0, 1.0 * max_resolution},
           "cells a side, n");
  set->Add(
      "nu_t", &nu_t, {0.0, 1000.0}, "diffusivity x time, for a side of 64");
  set->Add("relative_uncertainty",
           &uncertainty.relative,
           {0.0, 1.0},
           "of the inverse, per |y - P(x)| of a cell");
  set->Add("absolute_uncertainty",
           &uncertainty.absolute,
           {HeatUncertainty::kMinAbsolute, 1.0},
           "of the inverse, added to that");
}

std::shared_ptr<const SpectralDiffusion> HeatPhysics::MakeSimulator(
    int rows) const {
  const double dx = kBoxSide / resolution;
  return std::make_shared<SpectralDiffusion>(
      std::make_shared<FourierGrid>(rows, resolution), nu_t / (dx * dx));
}

template <int kDimensions>
bool HeatNetwork<kDimensions>::Create(LearningProblem* problem,
                                      std::string* error) const {
  const int n = physics.resolution;
  const int rows = kDimensions == 2 ? n : 1;
  const int hidden = kDimensions == 2 ? 128 : 64;
  const auto simulator = physics.MakeSimulator(rows);
  const int size = simulator->num_inputs();
  UNetOptions u_net;
  u_net.rows = rows;
  u_net.cols = n;
  u_net.keeps_mean = true;
  const std::shared_ptr<const Network> network =
      field.Make(u_net,
                 DenseNetwork({size, hidden, hidden, size}, Activation::kRelu),
                 error);
  if (network == nullptr) return false;
  const auto generate = [=](int num_states, std::uint32_t seed) {
    return RandomHeatStates(num_states, rows, n, seed);
  };
  const SampleSize sample_size = {
      num_samples, size, 3.0 * size, fmt::format(":resolution={}", n)};
  const auto generate_all = [&](int num_rows) {
    return generate(num_rows, data_seed);
  };
  if (!MakeData(sample_size, generate_all, problem, error)) return false;
  SplitSamples(
      SamplesOfFields(*simulator, problem->data.transpose()), 128, problem);
  const auto make_samples = [simulator, generate](int num, std::uint32_t seed) {
    return SamplesOfFields(*simulator, generate(num, seed).transpose());
  };
  problem->source =
      field.MakeSource(make_samples, "random rectangles", data_seed);
  problem->metric =
      metric == "x_loss" ? SolutionLoss(metric) : SolutionDistance(metric);
  if (metric == "x_l1_cut") {
    problem->metric->evaluate = [](const Eigen::MatrixXd& x,
                                   const DataSet& samples) {
      return (x.cwiseMax(0.0) - samples.solutions).cwiseAbs().mean();
    };
  }
  problem->inverse =
      std::make_shared<HeatInverse>(simulator, physics.uncertainty);
  problem->input_shape = {1, rows, n};
  problem->num_epochs = 25;
  problem->model =
      std::make_shared<Model>(network,
                              simulator,
                              std::make_shared<SquaredNormLoss>(size, 0.5),
                              Reduction::kSum);
  return true;
}

template struct HeatNetwork<1>;
template struct HeatNetwork<2>;

bool HeatState::Create(PointProblem* problem, std::string* /*error*/) const {
  const int n = physics.resolution;
  const auto simulator = physics.MakeSimulator(n);
  const Eigen::MatrixXd state =
      RandomHeatStates(1, n, n, data_seed).transpose();
  problem->target = SamplesOfFields(*simulator, state).targets;
  problem->simulator = simulator;
  problem->inverse =
      std::make_shared<HeatInverse>(simulator, physics.uncertainty);
  problem->loss = std::make_shared<SquaredNormLoss>(n * n, 0.5);
  problem->start = Eigen::VectorXd::Zero(n * n);
  problem->minimizer = state;
  problem->minimum = 0.0;
  problem->field_rows = n;
  return true;
}

Eigen::MatrixXd RandomHeatStates(int num_states,
                                 int rows,
                                 int cols,
                                 std::uint32_t seed) {
  using RowMajorMatrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  NumpyRandom random(seed);
  const bool is_interval = rows == 1;
  const int num_axes = is_interval ? 1 : 2;
  Eigen::MatrixXd states(num_states, rows * cols);
  for (int n = 0; n < num_states; ++n) {
    const int num_rectangles = static_cast<int>(4.0 + 7.0 * random.Rand());
    RowMajorMatrix state = RowMajorMatrix::Zero(rows, cols);
    for (int i = 0; i < kMaxRectangles; ++i) {
      const Eigen::MatrixXd u = random.Rand(2, num_axes);
      const double strength = random.Rand();
      if (i >= num_rectangles) continue;
      const Eigen::VectorXd along_rows =
          is_interval ? Eigen::VectorXd::Ones(1)
                      : RandomShares(rows, u(0, 0), u(1, 0));
      const Eigen::VectorXd along_cols =
          RandomShares(cols, u(0, num_axes - 1), u(1, num_axes - 1));
      state += strength * along_rows * along_cols.transpose();
    }
    states.row(n) = state.reshaped<Eigen::RowMajor>().transpose();
  }
  return states;
}

}  // namespace invgrad
