// What learning problems whose samples are one array have in common.
#ifndef PROBLEMS_SAMPLE_DATA_H_
#define PROBLEMS_SAMPLE_DATA_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/chain/data_set.h"
#include "problems/problem.h"

namespace invgrad {

// Whether the data have `num_columns` columns and two rows or more; if not,
// *error says what they have.
bool CheckDataShape(const Eigen::MatrixXd& data,
                    int num_columns,
                    std::string* error);

// Whether the data of a problem fit into memory, before they are made: an array
// of `num_columns` numbers a sample, and a DataSet of `num_rows` in all its
// arrays, which SplitSamples has twice. There are `data->rows()` samples, or,
// if it is null, twice num_samples. *error names num_samples and `settings`
// (":resolution=32"), on which the size of a sample depends.
bool CheckDataMemory(const Eigen::MatrixXd* data,
                     int num_samples,
                     double num_columns,
                     double num_rows,
                     const std::string& settings,
                     std::string* error);

// The first half of the samples is for training, the others are for testing. A
// batch has `batch_size` samples, or all for training if they are fewer.
void SplitSamples(const DataSet& samples,
                  int batch_size,
                  LearningProblem* problem);

}  // namespace invgrad

#endif  // PROBLEMS_SAMPLE_DATA_H_
