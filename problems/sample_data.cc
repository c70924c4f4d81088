#include "problems/sample_data.h"

#include <algorithm>

#include "invgrad/core/memory_limit.h"

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

bool CheckDataMemory(const Eigen::MatrixXd* data,
                     int num_samples,
                     double num_columns,
                     double num_rows,
                     const std::string& settings,
                     std::string* error) {
  const double num_all =
      data != nullptr ? static_cast<double>(data->rows()) : 2.0 * num_samples;
  const std::string who =
      data != nullptr ? "data of " + std::to_string(data->rows()) + " samples"
                      : "num_samples=" + std::to_string(num_samples);
  return FitsInMemory(
      who + settings,
      {{"its data", sizeof(double) * num_all * (num_columns + 2.0 * num_rows)}},
      0.0,
      error);
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
