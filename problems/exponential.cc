#include "problems/exponential.h"

#include <cmath>
#include <memory>
#include <optional>

#include "invgrad/chain/autodiff_simulator.h"
#include "invgrad/chain/loss.h"
#include "invgrad/io/numpy_random.h"
#include "problems/sample_data.h"

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

std::optional<Eigen::VectorXd> Invert(
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
  if (!CheckDataMemory(data, options.num_samples, 1, 3, "", error)) {
    return false;
  }
  if (data != nullptr) {
    if (!CheckDataShape(*data, 1, error)) return false;
    problem->data = *data;
  } else {
    problem->data = -options.range *
                    NumpyRandom(static_cast<std::uint32_t>(options.data_seed))
                        .Rand(2 * options.num_samples, 1);
  }
  DataSet all;
  all.solutions = problem->data.transpose();
  all.targets = all.solutions.array().exp();
  all.inputs = all.targets;
  all.contexts.resize(0, all.inputs.cols());
  SplitSamples(all, 100, problem);
  problem->model = std::make_shared<Model>(
      DenseNetwork({1, 16, 64, 16, 1}, Activation::kSigmoid),
      std::make_shared<AutoDiffSimulator<ExponentialPhysics, 1, 1>>(),
      std::make_shared<SquaredNormLoss>(1, 0.5),
      Reduction::kMean);
  problem->inverse = Inverse(Invert);
  problem->metric =
      Metric{"distance", [](const Eigen::MatrixXd& x, const DataSet& samples) {
               return (x - samples.solutions).cwiseAbs().mean();
             }};
  problem->num_epochs = 100;
  return true;
}

}  // namespace invgrad
