// Asks how the cost of a half-inverse step grows with the number of weights n
// and with the rows m of the batch's Jacobian.
//
// A network 64-w-w-64 in front of a random linear simulator with 64 outputs:
// n grows with w at m = 1,024, and m with the batch at w = 200. Each point is
// the least time of some steps, one BLAS thread; for comparison the LAPACK SVD
// of the dense J (route svd), up to --svd_seconds.
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
#include <cstdio>
#include <iostream>
#include <string>
#include <vector>

#include "bin/support/program.h"
#include "gflags/gflags.h"
#include "invgrad/chain/network_jacobian.h"
#include "invgrad/core/blas.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/spectral/spectral_step.h"
#include "report/plot.h"
#include "report/table.h"

DEFINE_string(output_directory, "runs/step_cost", "must exist");
DEFINE_int32(largest_width, 900, "of the hidden layers, at m = 1,024");
DEFINE_int32(largest_batch, 64, "m / 64, at hidden layers of width 200");
DEFINE_double(svd_seconds, 10.0, "the curves of the SVD end above this");

namespace invgrad {
namespace {

constexpr int kOutputs = 64;
constexpr int kFixedBatch = 16;  // m = 1,024
constexpr int kFixedWidth = 200;

struct Point {
  int m;
  int n;
  double seconds;
};

NetworkJacobian MakeJacobian(int width, int batch_size) {
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

// The least of some steps, none but the first cold.
Point Measure(const JacobianOperator& J, SpectralRoute route) {
  using Clock = std::chrono::steady_clock;
  const Eigen::VectorXd g = Eigen::VectorXd::Ones(J.rows());
  SpectralStepOptions options;
  options.route = route;
  SpectralWorkspace workspace;
  SpectralStepSummary summary;
  Eigen::VectorXd d;
  double least = 0.0;
  double total = 0.0;
  constexpr int kMostSteps = 20;
  constexpr double kEnoughSeconds = 1.0;
  for (int i = 0; i < kMostSteps && (i < 2 || total < kEnoughSeconds); ++i) {
    const Clock::time_point start = Clock::now();
    if (!SpectralStep(J,
                      g,
                      SpectralFilter::HalfInverse(1e-4),
                      options,
                      &workspace,
                      &d,
                      &summary)) {
      std::cerr << summary.message << "\n";
    }
    const double seconds =
        std::chrono::duration<double>(Clock::now() - start).count();
    if (i == 0 && seconds > kEnoughSeconds && route == SpectralRoute::kSvd) {
      return {J.rows(), J.cols(), seconds};
    }
    least = i < 2 ? seconds : std::min(least, seconds);
    total += seconds;
  }
  return {J.rows(), J.cols(), least};
}

// p of y ~ x^p, by least squares over the upper half of the points.
double Exponent(const std::vector<double>& x, const std::vector<double>& y) {
  const size_t first = x.size() / 2;
  const double count = static_cast<double>(x.size() - first);
  double mean_x = 0.0;
  double mean_y = 0.0;
  for (size_t i = first; i < x.size(); ++i) {
    mean_x += std::log(x[i]) / count;
    mean_y += std::log(y[i]) / count;
  }
  double xy = 0.0;
  double xx = 0.0;
  for (size_t i = first; i < x.size(); ++i) {
    xy += (std::log(x[i]) - mean_x) * (std::log(y[i]) - mean_y);
    xx += std::pow(std::log(x[i]) - mean_x, 2);
  }
  return xy / xx;
}

struct Curve {
  std::string route;
  std::vector<double> x;
  std::vector<double> seconds;
};

// One route over growing problems, until it takes too long.
Curve MeasureCurve(SpectralRoute route,
                   const std::vector<std::pair<int, int>>& sizes,
                   bool by_weights,
                   double most_seconds,
                   std::string* csv) {
  Curve curve{SpectralRouteName(route), {}, {}};
  for (const auto& [width, batch_size] : sizes) {
    const NetworkJacobian J = MakeJacobian(width, batch_size);
    const Point point = Measure(J, route);
    curve.x.push_back(by_weights ? point.n : point.m);
    curve.seconds.push_back(point.seconds);
    char line[200];
    std::snprintf(line,
                  sizeof line,
                  "%s,%s,%d,%d,%.6g\n",
                  by_weights ? "n" : "m",
                  curve.route.c_str(),
                  point.m,
                  point.n,
                  point.seconds);
    *csv += line;
    std::cout << line << std::flush;
    if (point.seconds > most_seconds) break;
  }
  return curve;
}

Plot Panel(const std::string& title,
           const std::string& x_label,
           const std::vector<Curve>& curves) {
  Plot plot;
  plot.title = title;
  plot.x_label = x_label;
  plot.y_label = "seconds a step";
  plot.log_x = true;
  plot.log_y = true;
  for (const Curve& curve : curves) {
    char exponent[50];
    std::snprintf(exponent,
                  sizeof exponent,
                  ": exponent %.2f",
                  Exponent(curve.x, curve.seconds));
    Series series;
    series.title = curve.route + exponent;
    series.x = curve.x;
    series.y = curve.seconds;
    series.style = Series::Style::kLinesAndPoints;
    plot.series.push_back(series);
  }
  return plot;
}

int Run() {
  if (FLAGS_largest_width < 30) return Fail("--largest_width: at least 30");
  if (FLAGS_largest_batch < 4) return Fail("--largest_batch: at least 4");
  SetBlasThreads(1);
  std::vector<std::pair<int, int>> by_weights;
  for (double width = 30.0; width <= FLAGS_largest_width; width *= 1.4) {
    by_weights.emplace_back(static_cast<int>(width), kFixedBatch);
  }
  std::vector<std::pair<int, int>> by_rows;
  for (double batch = 2.0; batch <= FLAGS_largest_batch; batch *= 1.4142136) {
    by_rows.emplace_back(kFixedWidth, static_cast<int>(std::lround(batch)));
  }
  std::string csv = "against,route,m,n,seconds\n";
  std::cout << csv;
  std::vector<Plot> panels;
  Table table({{"route", Table::Align::kLeft},
               {"against"},
               {"exponent of the upper half"}});
  for (const bool weights : {true, false}) {
    std::vector<Curve> curves;
    for (const SpectralRoute route :
         {SpectralRoute::kGram, SpectralRoute::kSvd}) {
      curves.push_back(
          MeasureCurve(route,
                       weights ? by_weights : by_rows,
                       weights,
                       route == SpectralRoute::kSvd ? FLAGS_svd_seconds : 1e9,
                       &csv));
      char exponent[50];
      std::snprintf(exponent,
                    sizeof exponent,
                    "%.2f",
                    Exponent(curves.back().x, curves.back().seconds));
      table.AddRow({curves.back().route, weights ? "n" : "m", exponent});
    }
    panels.push_back(weights ? Panel("m = 1,024", "weights n", curves)
                             : Panel("n = 66,064", "rows m", curves));
  }
  std::cout << "\n" << table.ToText();
  std::string error;
  const std::string path = FLAGS_output_directory + "/step_cost";
  if (!WriteFile(path + ".csv", csv, &error) ||
      !WritePlots(path + ".png", panels, &error)) {
    return Fail(error);
  }
  return 0;
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
