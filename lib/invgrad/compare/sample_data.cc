#include "invgrad/compare/sample_data.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "fmt/core.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/random.h"

namespace invgrad {

void DescribeSamples(
    int min, double max, int* num_samples, int* data_seed, OptionSet* set) {
  set->Add("num_samples",
           num_samples,
           {1.0 * min, max},
           "training samples; as many again are for testing");
  set->Add("data_seed", data_seed, {0, 2147483647}, "np.random.seed");
}

bool MakeData(const SampleSize& size,
              const std::function<Eigen::MatrixXd(int num_rows)>& generate,
              LearningProblem* problem,
              std::string* error) {
  Eigen::MatrixXd& data = problem->data;
  const bool is_given = data.size() > 0;
  const double num_all =
      is_given ? static_cast<double>(data.rows()) : 2.0 * size.num_samples;
  const std::string who = is_given
                              ? fmt::format("data of {} samples", data.rows())
                              : fmt::format("num_samples={}", size.num_samples);
  // Memory of the array, and of a DataSet that SplitSamples copies.
  const double bytes =
      sizeof(double) * num_all * (size.num_columns + 2.0 * size.num_values);
  if (!FitsInMemory(who + size.settings, {{"its data", bytes}}, 0.0, error)) {
    return false;
  }
  if (is_given) return CheckDataShape(data, size.num_columns, error);
  const int num_rows = 2 * size.num_samples;
  data = generate(num_rows);
  if (data.rows() == num_rows && data.cols() == size.num_columns) return true;
  *error = fmt::format(
      "the problem generates data of shape ({}, {}), and its SampleSize says "
      "({}, {}): 2 num_samples, num_columns",
      data.rows(),
      data.cols(),
      num_rows,
      size.num_columns);
  return false;
}

bool CheckDataShape(const Eigen::MatrixXd& data,
                    int num_columns,
                    std::string* error) {
  if (data.cols() == num_columns && data.rows() >= 2) return true;
  *error = fmt::format(
      "data must have shape (2 samples or more, {}), found ({}, {})",
      num_columns,
      data.rows(),
      data.cols());
  return false;
}

bool MakeUniformData(const SampleSize& size,
                     double low,
                     double high,
                     int seed,
                     LearningProblem* problem,
                     std::string* error) {
  const auto generate = [&](int num_rows) -> Eigen::MatrixXd {
    NumpyRandom random(static_cast<std::uint32_t>(seed));
    return low + (high - low) * random.Rand(num_rows, size.num_columns).array();
  };
  return MakeData(size, generate, problem, error);
}

void SplitSamples(DataSet samples, int batch_size, LearningProblem* problem) {
  const int num_train = samples.num_samples() / 2;
  if (samples.contexts.cols() == 0) {
    samples.contexts.resize(0, samples.num_samples());
  }
  problem->train = samples.Range(0, num_train);
  problem->test = samples.Range(num_train, samples.num_samples() - num_train);
  problem->batch_size = std::min(batch_size, num_train);
}

Metric SolutionDistance(const std::string& name) {
  return {name, [](const Eigen::MatrixXd& x, const DataSet& samples) {
            return (x - samples.solutions).cwiseAbs().mean();
          }};
}

Metric SolutionLoss(const std::string& name) {
  return {name, [](const Eigen::MatrixXd& x, const DataSet& samples) {
            return 0.5 * (x - samples.solutions).colwise().squaredNorm().mean();
          }};
}

void DescribeTargetNoise(double* noise, OptionSet* set) {
  set->Add("noise",
           noise,
           {0.0, 1e6},
           "deviation of noise in the training targets, over their root mean "
           "square");
}

void AddTargetNoise(double noise, int data_seed, LearningProblem* problem) {
  if (noise == 0.0) return;
  Eigen::MatrixXd& targets = problem->train.targets;
  const double deviation =
      noise *
      std::sqrt(targets.squaredNorm() / static_cast<double>(targets.size()));
  NumpyRandom random(static_cast<std::uint32_t>(data_seed) ^ 0x9e3779b9U);
  targets.reshaped() +=
      deviation * random.Normal(static_cast<int>(targets.size()));
}

}  // namespace invgrad
