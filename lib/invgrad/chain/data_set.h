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
  Eigen::MatrixXd inputs;    // |a| x N: a
  Eigen::MatrixXd contexts;  // |c| x N: c; 0 x N if none
  Eigen::MatrixXd targets;   // |y| x N: y*
  // |x| x N: solutions x of P(x) = y*, for supervised training; 0 x N if
  // unknown.
  Eigen::MatrixXd solutions;

  int num_samples() const { return static_cast<int>(inputs.cols()); }

  // c of a sample; without contexts a null vector of size 0.
  Eigen::Map<const Eigen::VectorXd> Context(int sample) const {
    // An array without rows may have no columns.
    return {contexts.rows() == 0 ? nullptr : contexts.col(sample).data(),
            contexts.rows()};
  }

  // The samples `indices`, in that order.
  DataSet Select(const std::vector<int>& indices) const;

  // The samples first, ..., first + count - 1.
  DataSet Range(int first, int count) const;

  // Returns false if a value is not finite; *error names array, sample and
  // entry.
  bool IsFinite(std::string* error) const;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_DATA_SET_H_
