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

// The first half of the samples is for training, the others are for testing. A
// batch has `batch_size` samples, or all for training if they are fewer.
void SplitSamples(const DataSet& samples,
                  int batch_size,
                  LearningProblem* problem);

}  // namespace invgrad

#endif  // PROBLEMS_SAMPLE_DATA_H_
