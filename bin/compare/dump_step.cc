#include "bin/compare/dump_step.h"

#include <filesystem>
#include <iostream>
#include <memory>

#include "bin/support/run_directory.h"
#include "bin/support/training.h"
#include "fmt/core.h"
#include "invgrad/io/npy.h"

namespace invgrad {

namespace {

bool DumpMethod(const Model& model,
                const DataSet& batch,
                const Method& method,
                const Eigen::VectorXd& weights,
                const std::string& directory,
                std::string* error) {
  const std::unique_ptr<UpdateRule> rule = method.phases[0].MakeRule();
  LinearizationParts parts = rule->Needs();
  parts.gradient = true;
  parts.jacobian = true;
  Linearization at_weights;
  Eigen::MatrixXd outputs, J;
  Eigen::VectorXd step;
  if (!model.Linearize(weights, batch, parts, &at_weights, error) ||
      !model.Predict(weights, batch, &outputs, error) ||
      !rule->ComputeStep(at_weights, &step, error)) {
    *error = method.label + ": " + *error;
    return false;
  }
  at_weights.jacobian->ToDense(&J);
  std::error_code failure;
  std::filesystem::create_directories(directory, failure);
  if (failure) {
    *error = directory + ": " + failure.message();
    return false;
  }
  const Eigen::MatrixXd rows = outputs.transpose();
  return WriteNpy(directory + "/weights.npy", weights, error) &&
         WriteNpy(directory + "/outputs.npy", rows, error) &&
         WriteNpy(directory + "/J.npy", J, error) &&
         WriteNpy(directory + "/g.npy", at_weights.loss_gradient, error) &&
         WriteNpy(directory + "/gradient.npy", at_weights.gradient, error) &&
         WriteNpy(directory + "/step.npy", step, error);
}

}  // namespace

bool DumpStep(const LearningProblem& problem,
              const std::vector<Method>& methods,
              int batch_size,
              const Eigen::VectorXd& weights,
              const std::string& directory,
              std::string* error) {
  for (const Method& method : methods) {
    if (method.phases[0].ceres == nullptr) continue;
    *error = fmt::format(
        "--dump_step: '{}' is a minimizer of Ceres and has no step to dump",
        method.label);
    return false;
  }
  if (std::filesystem::exists(directory)) {
    *error =
        fmt::format("--dump_step={} exists; give another directory", directory);
    return false;
  }
  for (const Method& method : methods) {
    const DataSet batch = problem.train.Range(
        0, BatchSize(problem, method.phases[0], batch_size));
    const std::string folder = directory + "/" + FileName(method.label);
    if (!DumpMethod(*problem.model, batch, method, weights, folder, error)) {
      return false;
    }
    std::cout << "wrote " << folder << "\n";
  }
  return true;
}

}  // namespace invgrad
