// Small problems that every method can take, for tests.
#ifndef INVGRAD_TESTS_METHODS_LINE_H_
#define INVGRAD_TESTS_METHODS_LINE_H_

#include <memory>
#include <string>
#include <utility>

#include "invgrad/loss.h"
#include "invgrad/minimize.h"
#include "invgrad/random.h"
#include "invgrad/train.h"

namespace invgrad {

// y = 2 a - 1 to be learnt by 1-3-1, 12 samples, no test data.
struct Line {
  Model model;
  DataSet train;
  DataSet test;
  Eigen::VectorXd weights;

  explicit Line(std::shared_ptr<const Loss> loss =
                    std::make_shared<SquaredNormLoss>(1, 1.0),
                int num_hidden = 3)
      : model(DenseNetwork({1, num_hidden, 1}, Activation::kTanh),
              std::make_shared<IdentitySimulator>(1),
              std::move(loss),
              Reduction::kMean) {
    NumpyRandom random(5);
    train.inputs = random.Rand(1, 12);
    train.contexts.resize(0, 12);
    train.targets = 2.0 * train.inputs.array() - 1.0;
    train.solutions = train.targets;
    test = train.Range(0, 0);
    weights =
        model.network().InitialWeights(Initialization::kGlorotUniform, &random);
  }
};

inline TrainResult TrainLine(const std::string& method,
                             const Line& line,
                             TrainOptions options) {
  options.initial_weights = line.weights;
  return Train(line.model, {line.train, line.test}, method, options);
}

// L = 1/2 |x - (1, 2)|^2 or (x_0 - 1)^4.
inline PointObjective Objective(std::shared_ptr<const Loss> loss) {
  const int size = loss->size();
  return PointObjective(std::make_shared<IdentitySimulator>(size),
                        std::move(loss),
                        Eigen::VectorXd::LinSpaced(size, 1.0, size),
                        Eigen::VectorXd::Constant(size, 5.0));
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_METHODS_LINE_H_
