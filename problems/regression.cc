#include "problems/regression.h"

#include <cmath>
#include <memory>

#include "invgrad/chain/loss.h"
#include "invgrad/chain/simulator.h"
#include "problems/sample_data.h"

namespace invgrad {

bool MakeRegression(const Eigen::MatrixXd& samples,
                    Variance variance,
                    LearningProblem* problem,
                    std::string* error) {
  const int num_inputs = static_cast<int>(samples.cols()) - 1;
  DataSet all;
  all.inputs = samples.leftCols(num_inputs).transpose();
  all.targets = samples.rightCols(1).transpose();
  all.contexts.resize(0, all.num_samples());
  SplitSamples(all, 32, problem);

  const Eigen::ArrayXXd targets = problem->train.targets;
  const double mean = targets.mean();
  const double count = static_cast<double>(targets.size());
  const double deviation =
      std::sqrt((targets - mean).square().sum() /
                (variance == Variance::kUnbiased ? count - 1.0 : count));
  if (!(deviation > 0.0 && std::isfinite(deviation))) {
    *error = "the training targets (the last column of the first " +
             std::to_string(targets.size()) +
             " samples) have no positive, finite standard deviation";
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
  problem->data = samples;
  return true;
}

}  // namespace invgrad
