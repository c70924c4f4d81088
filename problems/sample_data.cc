#include "problems/sample_data.h"

#include <algorithm>

namespace invgrad {

bool CheckDataShape(const Eigen::MatrixXd& data,
                    int num_columns,
                    std::string* error) {
  if (data.cols() == num_columns && data.rows() >= 2) return true;
  *error = "data must have shape (2 samples or more, " +
           std::to_string(num_columns) + "), found (" +
           std::to_string(data.rows()) + ", " + std::to_string(data.cols()) +
           ")";
  return false;
}

void SplitSamples(const DataSet& samples,
                  int batch_size,
                  LearningProblem* problem) {
  const int num_train = samples.num_samples() / 2;
  problem->train = samples.Range(0, num_train);
  problem->test = samples.Range(num_train, samples.num_samples() - num_train);
  problem->batch_size = std::min(batch_size, num_train);
}

}  // namespace invgrad
