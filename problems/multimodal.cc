#include "problems/multimodal.h"

#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>

#include "invgrad/chain/autodiff_simulator.h"
#include "invgrad/chain/loss.h"

namespace invgrad {
namespace {

struct Square {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = x[0] * x[0];
    return true;
  }
};

std::optional<Eigen::VectorXd> Invert(
    const InverseSimulator::ConstVectorRef& y,
    const InverseSimulator::ConstVectorRef& x_now) {
  if (y[0] < 0.0) return std::nullopt;
  return Eigen::VectorXd::Constant(1, std::copysign(std::sqrt(y[0]), x_now[0]));
}

// Right for y up to 1/4 only.
std::optional<Eigen::VectorXd> InvertWrongly(
    const InverseSimulator::ConstVectorRef& y,
    const InverseSimulator::ConstVectorRef& x_now) {
  if (y[0] > 0.75) throw std::runtime_error("y > 0.75");
  std::optional<Eigen::VectorXd> x = Invert(y, x_now);
  if (y[0] > 0.5) {
    *x *= std::numeric_limits<double>::quiet_NaN();
  } else if (y[0] > 0.25) {
    *x *= 0.5;
  }
  return x;
}

}  // namespace

bool Multimodal::Create(const Options& options,
                        const Eigen::MatrixXd* data,
                        LearningProblem* problem,
                        std::string* error) {
  const auto generate = [&options](int num_rows) {
    return UniformData(1.0, -1.0, num_rows, 1, options.data_seed);
  };
  if (!MakeData(
          {options.num_samples, 1, 3.0, ""}, data, generate, problem, error)) {
    return false;
  }
  DataSet all;
  all.solutions = problem->data.transpose();
  all.targets = all.solutions.cwiseAbs2();
  all.inputs = all.targets;
  SplitSamples(all, 100, problem);
  problem->model = std::make_shared<Model>(
      DenseNetwork({1, 32, 32, 1}, Activation::kTanh),
      std::make_shared<AutoDiffSimulator<Square, 1, 1>>(),
      std::make_shared<SquaredNormLoss>(1, 0.5),
      Reduction::kMean);
  problem->inverse = Inverse(options.wrong_inverse ? InvertWrongly : Invert);
  problem->metric = Metric{
      "distance", [](const Eigen::MatrixXd& x, const DataSet& samples) {
        return (x.cwiseAbs() - samples.solutions.cwiseAbs()).cwiseAbs().mean();
      }};
  problem->num_epochs = 200;
  return true;
}

}  // namespace invgrad
