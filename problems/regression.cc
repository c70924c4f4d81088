#include "problems/regression.h"

#include <cmath>
#include <memory>

#include "fmt/core.h"
#include "invgrad/chain/loss.h"
#include "invgrad/chain/simulator.h"
#include "problems/sample_data.h"

namespace invgrad {

bool MakeRegression(Variance variance,
                    LearningProblem* problem,
                    std::string* error) {
  const int num_inputs = static_cast<int>(problem->data.cols()) - 1;
  DataSet all;
  all.inputs = problem->data.leftCols(num_inputs).transpose();
  all.targets = problem->data.rightCols(1).transpose();
  SplitSamples(all, 32, problem);

  const Eigen::ArrayXXd targets = problem->train.targets;
  const double mean = targets.mean();
  const double count = static_cast<double>(targets.size());
  const double deviation =
      std::sqrt((targets - mean).square().sum() /
                (variance == Variance::kUnbiased ? count - 1.0 : count));
  if (!(deviation > 0.0 && std::isfinite(deviation))) {
    *error = fmt::format(
        "the training targets (the last column of the first {} samples) have "
        "no positive, finite standard deviation",
        targets.size());
    return false;
  }
  for (DataSet* part : {&problem->train, &problem->test}) {
    part->targets = (part->targets.array() - mean) / deviation;
  }

  problem->model = std::make_shared<Model>(
      DenseNetwork({num_inputs, 16, 16, 16, 1}, Activation::kGelu),
      std::make_shared<IdentitySimulator>(1),
      std::make_shared<SquaredNormLoss>(1, 1.0),
      Reduction::kSum);
  problem->initialization = Initialization::kPytorch;
  problem->num_epochs = 20;
  return true;
}

}  // namespace invgrad
