// A new problem from nothing to a comparison plot: where must a shuttlecock be
// sent so that it is at a given place one second later?
//
// 01_new_problem.md explains this program piece by piece.
//
// Sample runs:
//
//   01_new_problem
//   01_new_problem --seconds=2 --folder=/tmp
//   01_new_problem --rules=half_inverse:step_size=auto,ceres_lbfgs

#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "01_flight.h"
#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/gradient_checker.h"
#include "gflags/gflags.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/blas_threads.h"
#include "invgrad/method.h"
#include "invgrad/random.h"
#include "invgrad/train.h"

DEFINE_string(rules,
              "gradient_descent:step_size=3e-2,"
              "adam:step_size=1e-2:schedule=cosine,"
              "half_inverse,gauss_newton,"
              "levenberg_marquardt:relative_damping=1e-8,"
              "ceres_lm:linear_solver=dense_normal_cholesky",
              "what to compare; `compare --list` shows all rules and options");
DEFINE_double(seconds, 6.0, "training time of each rule");
DEFINE_int32(seed, 1, "of the initial weights");
DEFINE_string(folder, ".", "where shuttlecock_losses.txt goes");

namespace {

using invgrad::DataSet;
using invgrad::Model;
using invgrad::NumpyRandom;

// [check]
// The largest relative difference between the Jacobian by Jets and that by
// finite differences.
double JacobianError(const Eigen::Vector2d& x) {
  const ceres::AutoDiffCostFunction<Flight, 2, 2> flight(new Flight);
  const std::vector<const ceres::Manifold*> no_manifolds = {nullptr};
  const ceres::GradientChecker checker(
      &flight, &no_manifolds, ceres::NumericDiffOptions());
  const double* const parameters[] = {x.data()};
  ceres::GradientChecker::ProbeResults results;
  checker.Probe(parameters, 1e-6, &results);
  return results.maximum_relative_error;
}
// [/check]

// [data]
// Places to be at, up to a court's length away. The network sees the target.
DataSet DrawTargets(int num_samples, NumpyRandom* random) {
  Eigen::MatrixXd targets(2, num_samples);
  for (auto target : targets.colwise()) {
    target[0] = random->Uniform(1.0, 12.0);  // distance [m]
    target[1] = random->Uniform(-1.0, 2.0);  // height [m]
  }
  return invgrad::TrainingData(targets, targets).train;
}
// [/data]

}  // namespace

int main(int argc, char** argv) {
  gflags::SetUsageMessage("trains a network to aim a shuttlecock");
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  std::string error;
  std::vector<invgrad::Method> methods;
  if (!invgrad::ParseMethods(FLAGS_rules, &methods, &error)) {
    std::cerr << "--rules: " << error << "\n";
    return 1;
  }
  invgrad::SetBlasThreads(1);

  std::printf("Jacobian against finite differences: soft %.1g, smash %.1g\n\n",
              JacobianError({3.0, 5.0}),
              JacobianError({60.0, 9.0}));

  // [model]
  const Model model(
      invgrad::DenseNetwork({2, 16, 16, 2}, invgrad::Activation::kTanh),
      std::make_shared<invgrad::AutoDiffSimulator<Flight, 2, 2>>(),
      std::make_shared<invgrad::SquaredNormLoss>(2, 0.5),
      invgrad::Reduction::kMean);
  // [/model]
  NumpyRandom data_random(0);
  const DataSet train = DrawTargets(512, &data_random);
  const DataSet test = DrawTargets(512, &data_random);

  // [train]
  std::printf(
      "%-45s  train loss  test loss  miss [cm]   steps  ms/step  status\n",
      "rule");
  std::ofstream losses(FLAGS_folder + "/shuttlecock_losses.txt");
  for (const invgrad::Method& method : methods) {
    invgrad::TrainOptions options;
    options.max_time_in_seconds = FLAGS_seconds;
    options.batch_size = 32;
    options.seed = FLAGS_seed;
    std::cerr << "training: " << method.label << "\n";
    const invgrad::TrainResult result =
        invgrad::Train(model, {train, test}, method, options);
    if (!result.error.empty()) {
      std::cerr << method.label << ": " << result.error << "\n";
      return 1;
    }
    // [/train]

    // [row]
    const invgrad::HistoryRow& last = result.history.back();
    std::printf(
        "%-45s  %10.3g  %9.3g  %9.3g  %6ld  %7.3g  %s\n",
        method.label.c_str(),
        last.train_loss,
        last.test_loss,
        100.0 * std::sqrt(2.0 * last.test_loss),
        result.summary.num_steps,
        1e3 * result.summary.train_time_in_seconds / result.summary.num_steps,
        result.summary.message.c_str());
    // A block a rule, begun by its name.
    losses << '"' << method.label << "\"\n";
    for (const invgrad::HistoryRow& row : result.history) {
      if (row.step == 0) continue;  // has no place on a logarithmic axis
      losses << row.seconds << " " << row.test_loss << "\n";
    }
    losses << "\n\n";
    // [/row]
  }
  if (!losses.flush()) {
    std::cerr << "cannot write to the folder " << FLAGS_folder << "\n";
    return 1;
  }
  return 0;
}
