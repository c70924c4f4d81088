// Measures how the cost of a half-inverse step grows with the number of weights
// n and with the rows m of the batch's Jacobian.
//
// A network 64-w-w-64 in front of a random linear simulator with 64 outputs:
// n grows with w at m = 1,024, and m with the batch at w = 200. Each point is
// the minimal time of some steps with one BLAS thread.
//
// Sample runs:
//
//   step_cost --output_directory=runs/step_cost
//   step_cost --largest_width=300 --largest_batch=16 --svd_seconds=1
//
// Prints the exponents p of time ~ n^p and m^p, fitted to the upper half of
// each curve, and writes step_cost.csv and step_cost.png.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "bin/support/program.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/chain/network_jacobian.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/spectral/spectral_step.h"
#include "report/plot.h"

DEFINE_string(output_directory, "runs/step_cost", "must exist");
DEFINE_int32(largest_width, 900, "of the hidden layers, at m = 1,024");
DEFINE_int32(largest_batch, 64, "m / 64, at hidden layers of width 200");
DEFINE_double(svd_seconds, 10.0, "the curves of the SVD end above this");

namespace invgrad {
namespace {

constexpr int kOutputs = 64;

// The width of the hidden layers and the batch size.
using Size = std::pair<int, int>;

NetworkJacobian MakeJacobian(const Size& size) {
  const auto [width, batch_size] = size;
  const DenseNetwork network({kOutputs, width, width, kOutputs},
                             Activation::kTanh);
  NumpyRandom random(1);
  const Eigen::VectorXd weights =
      network.InitialWeights(Initialization::kGlorotUniform, &random);
  DenseNetwork::Activations activations;
  network.Forward(weights,
                  random.Rand(batch_size, kOutputs).transpose(),
                  false,
                  &activations);
  return NetworkJacobian(
      network,
      weights,
      activations,
      random.Rand(batch_size * kOutputs, kOutputs).transpose());
}

// Seconds: the least of some steps, none but the first cold; of a single one if
// it takes more than a second.
double Measure(const JacobianOperator& J,
               SpectralRoute route,
               RunCounts* counts) {
  using Clock = std::chrono::steady_clock;
  const Eigen::VectorXd g = Eigen::VectorXd::Ones(J.rows());
  SpectralStepOptions options;
  options.route = route;
  options.tolerance = std::numeric_limits<double>::infinity();
  options.threshold_tolerance = std::numeric_limits<double>::infinity();
  SpectralWorkspace workspace;
  SpectralStepSummary summary;
  Eigen::VectorXd d;
  double least = std::numeric_limits<double>::infinity();
  double total = 0.0;
  for (int i = 0; i < 20 && (i < 2 || total < 1.0); ++i) {
    const Clock::time_point start = Clock::now();
    const bool is_done = SpectralStep(J,
                                      g,
                                      SpectralFilter::HalfInverse(1e-4),
                                      options,
                                      &workspace,
                                      &d,
                                      &summary);
    counts->Add(is_done);
    if (!is_done) Warn(summary.message);
    const double seconds =
        std::chrono::duration<double>(Clock::now() - start).count();
    if (i == 0 && seconds > 1.0 && route == SpectralRoute::kSvd) return seconds;
    if (i > 0) least = std::min(least, seconds);
    total += seconds;
  }
  return least;
}

// One route over growing problems, until a step takes more than `most_seconds`,
// with the exponent of the upper half in its title.
Series MeasureCurve(SpectralRoute route,
                    const std::vector<Size>& sizes,
                    bool by_weights,
                    double most_seconds,
                    std::string* csv,
                    RunCounts* counts) {
  const std::string name = SpectralRouteName(route);
  Series curve;
  curve.style = Series::Style::kLinesAndPoints;
  for (const Size& size : sizes) {
    const NetworkJacobian J = MakeJacobian(size);
    curve.x.push_back(by_weights ? J.cols() : J.rows());
    curve.y.push_back(Measure(J, route, counts));
    const std::string line = fmt::format("{},{},{},{},{:.6g}\n",
                                         by_weights ? "n" : "m",
                                         name,
                                         J.rows(),
                                         J.cols(),
                                         curve.y.back());
    *csv += line;
    std::cout << line << std::flush;
    if (curve.y.back() > most_seconds) break;
  }
  // p of y ~ x^p, by least squares.
  const auto upper_logarithms = [](const std::vector<double>& values) {
    const Eigen::Map<const Eigen::ArrayXd> all(
        values.data(), static_cast<Eigen::Index>(values.size()));
    const Eigen::ArrayXd logs = all.tail(all.size() - all.size() / 2).log();
    return Eigen::ArrayXd(logs - logs.mean());
  };
  const Eigen::ArrayXd x = upper_logarithms(curve.x);
  const double exponent =
      (x * upper_logarithms(curve.y)).sum() / x.square().sum();
  curve.title = fmt::format("{}: exponent {:.2f}", name, exponent);
  return curve;
}

Plot MeasurePanel(const std::string& title,
                  const std::string& x_label,
                  const std::vector<Size>& sizes,
                  bool by_weights,
                  std::string* csv,
                  RunCounts* counts) {
  Plot plot;
  plot.title = title;
  plot.x_label = x_label;
  plot.y_label = "seconds a step";
  plot.log_x = true;
  plot.log_y = true;
  for (const auto& [route, most_seconds] :
       {std::pair(SpectralRoute::kGram, 1e9),
        std::pair(SpectralRoute::kSvd, FLAGS_svd_seconds)}) {
    plot.series.push_back(
        MeasureCurve(route, sizes, by_weights, most_seconds, csv, counts));
  }
  return plot;
}

bool Run(RunCounts* counts, std::string* error) {
  if (!CheckFlags({{"largest_width", {30.0}}, {"largest_batch", {4.0}}},
                  error)) {
    return false;
  }
  std::vector<Size> by_weights;
  for (double width = 30.0; width <= FLAGS_largest_width; width *= 1.4) {
    by_weights.emplace_back(static_cast<int>(width), 16);
  }
  std::vector<Size> by_rows;
  for (double batch = 2.0; batch <= FLAGS_largest_batch; batch *= 1.4142136) {
    by_rows.emplace_back(200, static_cast<int>(std::lround(batch)));
  }
  std::string csv = "against,route,m,n,seconds\n";
  std::cout << csv;
  const std::vector<Plot> panels = {
      MeasurePanel("m = 1,024", "weights n", by_weights, true, &csv, counts),
      MeasurePanel("n = 66,064", "rows m", by_rows, false, &csv, counts)};
  for (const Plot& panel : panels) {
    for (const Series& curve : panel.series) {
      std::cout << panel.x_label << ", " << curve.title << "\n";
    }
  }
  const std::string path = FLAGS_output_directory + "/step_cost";
  return NameFlag("output_directory",
                  WriteFile(path + ".csv", csv, error) &&
                      WritePlots(path + ".png", panels, error),
                  error);
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(
      argc,
      argv,
      "Measures the cost of a half-inverse step against n and against m.",
      invgrad::Run);
}
