// Samples of a learning problem, one column each.
//
// Shapes:  inputs: |a| x N;  contexts: |c| x N;  targets: |y| x N.
#ifndef INVGRAD_CHAIN_DATA_SET_H_
#define INVGRAD_CHAIN_DATA_SET_H_

#include <string>
#include <vector>

#include "Eigen/Core"

namespace invgrad {

struct DataSet {
  Eigen::MatrixXd inputs;    // |a| x N: what the network sees
  Eigen::MatrixXd contexts;  // |c| x N: the simulator's own data; 0 x N if none
  Eigen::MatrixXd targets;   // |y| x N: y*
  // |x| x N: an x with P(x) = y*, where the data were made from one; 0 x N if
  // none is known. What supervised training learns.
  Eigen::MatrixXd solutions;

  int num_samples() const { return static_cast<int>(inputs.cols()); }

  // The samples `indices`, in that order.
  DataSet Select(const std::vector<int>& indices) const;

  // The samples first, ..., first + count - 1.
  DataSet Range(int first, int count) const;

  // False if a value is not finite; then *error names array, sample and entry.
  bool IsFinite(std::string* error) const;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_DATA_SET_H_
