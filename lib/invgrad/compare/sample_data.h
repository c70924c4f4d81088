// The common part of learning problems with samples in one array: options, the
// array, its division into training and test samples, and noise.
#ifndef INVGRAD_COMPARE_SAMPLE_DATA_H_
#define INVGRAD_COMPARE_SAMPLE_DATA_H_

#include <functional>
#include <string>

#include "Eigen/Core"
#include "invgrad/compare/problem.h"
#include "invgrad/data.h"

namespace invgrad {

// The options num_samples (in [min, max]) and data_seed.
void DescribeSamples(
    int min, double max, int* num_samples, int* data_seed, OptionSet* set);

// The sizes that determine the memory of a problem's samples.
struct SampleSize {
  int num_samples = 0;    // for training, and as many for testing
  int num_columns = 0;    // of the array, which has a row for each sample
  double num_values = 0;  // of a sample, in all arrays of a DataSet
  // The other options that determine the size, for messages: ":resolution=32".
  std::string settings = "";
};

// Sets problem->data to generate(2 num_samples) if it is empty. Returns false,
// with *error set, if the problem does not fit into memory (checked first), or
// problem->data has another shape than CheckDataShape wants. What `generate`
// returns must have the rows that it is asked for, and num_columns columns.
bool MakeData(const SampleSize& size,
              const std::function<Eigen::MatrixXd(int num_rows)>& generate,
              LearningProblem* problem,
              std::string* error);

// Whether the data have `num_columns` columns and two rows or more; if not,
// *error states their shape.
bool CheckDataShape(const Eigen::MatrixXd& data,
                    int num_columns,
                    std::string* error);

// MakeData with uniform numbers:
// np.random.seed(seed); np.random.uniform(low, high, (2 N, num_columns))
bool MakeUniformData(const SampleSize& size,
                     double low,
                     double high,
                     int seed,
                     LearningProblem* problem,
                     std::string* error);

// The first half of the samples is for training, the second for testing. A
// batch has `batch_size` samples, but at most all training samples. Samples
// without contexts get empty ones.
void SplitSamples(DataSet samples, int batch_size, LearningProblem* problem);

// mean |x - x*| over the data's solutions x*.
Metric SolutionDistance(const std::string& name);

// The mean over the samples of 1/2 |x - x*|^2.
Metric SolutionLoss(const std::string& name);

// The option `noise` of problems whose training targets may be noisy:
//
//   y*_i += noise rms(y*) z_i,   z_i standard normal
//
// with the root mean square of all entries of the training targets. If L is
// c |y - y*|^2, the training loss of a perfect network is c |y*| noise^2 rms^2.
// Stream: np.random.seed(data_seed ^ 0x9e3779b9), independent of the data's.
void DescribeTargetNoise(double* noise, OptionSet* set);
void AddTargetNoise(double noise, int data_seed, LearningProblem* problem);

}  // namespace invgrad

#endif  // INVGRAD_COMPARE_SAMPLE_DATA_H_
