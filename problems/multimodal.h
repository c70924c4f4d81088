// A simulator with two pre-images for every target: supervised training
// averages them, an inverse returns one.
//
//   y = x^2,   L = 1/2 (y - y*)^2,   y* = (x*)^2,   x* uniform in (-1, 1]
//
// Shapes:  network 1-32-32-1, tanh, its input is y*;  x, y: 1.
// Data:    np.random.seed(data_seed); x* = 1 - 2 np.random.rand(2 N), the first
//          N for training; x* is the data's solution.
// Inverse: sign(x_0) sqrt(y), local; y < 0 has no pre-image.
// Metric:  mean distance of x to the nearer of the two pre-images of y*.
// Facts:   the best supervised map is the mean of the solutions, x = 0, whose
//          metric is the mean of |x*|, 1/2.
// Source:  PBDL, chapters intro-teaser and physgrad-nn.
#ifndef PROBLEMS_MULTIMODAL_H_
#define PROBLEMS_MULTIMODAL_H_

#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/sample_data.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/loss.h"

namespace invgrad {

struct Multimodal {
  int num_samples = 2000;
  int data_seed = 0;
  bool wrong_inverse = false;
  void Describe(OptionSet* set) {
    DescribeSamples(1, 1e7, &num_samples, &data_seed, set);
    set->Add("wrong_inverse",
             &wrong_inverse,
             "an inverse that is wrong for y in (0.25, 0.5), NaN in (0.5, "
             "0.75) and throws above: it is to be caught");
  }

  struct Physics {
    template <typename T>
    bool operator()(const T* x, T* y) const {
      y[0] = x[0] * x[0];
      return true;
    }
  };

  static std::optional<Eigen::VectorXd> Invert(
      const InverseSimulator::ConstVectorRef& y,
      const InverseSimulator::ConstVectorRef& x_now) {
    if (y[0] < 0.0) return std::nullopt;
    return Eigen::VectorXd::Constant(1,
                                     std::copysign(std::sqrt(y[0]), x_now[0]));
  }

  // Right for y up to 1/4 only.
  static std::optional<Eigen::VectorXd> InvertWrongly(
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

  bool Create(LearningProblem* problem, std::string* error) const {
    if (!MakeUniformData(
            {num_samples, 1, 3.0}, 1.0, -1.0, data_seed, problem, error)) {
      return false;
    }
    DataSet all;
    all.solutions = problem->data.transpose();
    all.targets = all.solutions.cwiseAbs2();
    all.inputs = all.targets;
    SplitSamples(all, 100, problem);
    problem->model = std::make_shared<Model>(
        DenseNetwork({1, 32, 32, 1}, Activation::kTanh),
        std::make_shared<AutoDiffSimulator<Physics, 1, 1>>(),
        std::make_shared<SquaredNormLoss>(1, 0.5),
        Reduction::kMean);
    problem->inverse = Inverse(wrong_inverse ? InvertWrongly : Invert);
    problem->metric = Metric{
        "distance", [](const Eigen::MatrixXd& x, const DataSet& samples) {
          return (x.cwiseAbs() - samples.solutions.cwiseAbs())
              .cwiseAbs()
              .mean();
        }};
    problem->num_epochs = 200;
    return true;
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_MULTIMODAL_H_
