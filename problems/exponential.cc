#include "problems/exponential.h"

#include <cmath>
#include <memory>
#include <optional>

#include "invgrad/chain/autodiff_simulator.h"
#include "invgrad/chain/loss.h"

namespace invgrad {
namespace {

struct ExponentialPhysics {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::exp;
    y[0] = exp(x[0]);
    return true;
  }
};

std::optional<Eigen::VectorXd> InvertExponential(
    const InverseSimulator::ConstVectorRef& y,
    const InverseSimulator::ConstVectorRef& /*x_now*/) {
  if (!(y[0] > 0.0)) return std::nullopt;
  return Eigen::VectorXd::Constant(1, std::log(y[0]));
}

}  // namespace

bool Exponential::Create(const Options& options,
                         const Eigen::MatrixXd* data,
                         LearningProblem* problem,
                         std::string* error) {
  const auto generate = [&options](int num_rows) {
    return UniformData(0.0, -options.range, num_rows, 1, options.data_seed);
  };
  if (!MakeData(
          {options.num_samples, 1, 3.0, ""}, data, generate, problem, error)) {
    return false;
  }
  DataSet all;
  all.solutions = problem->data.transpose();
  all.targets = all.solutions.array().exp();
  all.inputs = all.targets;
  SplitSamples(all, 100, problem);
  problem->model = std::make_shared<Model>(
      DenseNetwork({1, 16, 64, 16, 1}, Activation::kSigmoid),
      std::make_shared<AutoDiffSimulator<ExponentialPhysics, 1, 1>>(),
      std::make_shared<SquaredNormLoss>(1, 0.5),
      Reduction::kMean);
  problem->inverse = Inverse(InvertExponential);
  problem->metric = SolutionDistance("distance");
  return true;
}

}  // namespace invgrad
