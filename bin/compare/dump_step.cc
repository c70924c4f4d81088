#include "bin/compare/dump_step.h"

#include <filesystem>
#include <iostream>
#include <memory>

#include "bin/support/run_directory.h"
#include "fmt/core.h"
#include "invgrad/io/npy.h"

namespace invgrad {

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
  const Model& model = *problem.model;
  for (const Method& method : methods) {
    const Phase& phase = method.phases[0];
    const DataSet batch = problem.train.Range(
        0, phase.BatchSize(batch_size, problem.train.num_samples()));
    const std::unique_ptr<UpdateRule> rule = phase.MakeRule();
    LinearizationParts parts = rule->Needs();
    parts.gradient = true;
    parts.jacobian = true;
    Linearization at_weights;
    Eigen::MatrixXd y, J;
    Eigen::VectorXd step;
    if (!model.Linearize(weights, batch, parts, &at_weights, error) ||
        !model.Predict(weights, batch, &y, error) ||
        !rule->ComputeStep(at_weights, &step, error)) {
      *error = method.label + ": " + *error;
      return false;
    }
    at_weights.jacobian->ToDense(&J);
    y.transposeInPlace();
    const std::string folder = directory + "/" + FileName(method.label);
    if (!MakeDirectories(folder, error) ||
        !WriteNpy(folder + "/weights.npy", weights, error) ||
        !WriteNpy(folder + "/outputs.npy", y, error) ||
        !WriteNpy(folder + "/J.npy", J, error) ||
        !WriteNpy(folder + "/g.npy", at_weights.loss_gradient, error) ||
        !WriteNpy(folder + "/gradient.npy", at_weights.gradient, error) ||
        !WriteNpy(folder + "/step.npy", step, error)) {
      return false;
    }
    std::cout << "wrote " << folder << "\n";
  }
  return true;
}

}  // namespace invgrad
