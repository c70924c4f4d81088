#include "invgrad/train/evaluation.h"

#include <limits>
#include <string>

namespace invgrad {

double MeanLoss(const Model& model,
                const Eigen::VectorXd& weights,
                const DataSet& data) {
  double cost = 0.0;
  std::string ignored;
  if (!model.Cost(weights, data, &cost, &ignored)) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const int num_samples = data.num_samples();
  return cost / (model.BatchScale(num_samples) * num_samples);
}

bool IsEvaluationEpoch(long epoch) {
  // Spacing 1 up to 40, 2 up to 80, 4 up to 160, ...
  long spacing = 1;
  while (epoch > 40 * spacing) spacing *= 2;
  return epoch % spacing == 0;
}

}  // namespace invgrad
