// Tensors as matrices of Eigen, in double precision.
#ifndef INVGRAD_TORCH_TORCH_TENSORS_H_
#define INVGRAD_TORCH_TORCH_TENSORS_H_

#include <vector>

#include "Eigen/Core"
#include "torch/torch.h"

namespace invgrad {

// A column for each entry of the first dimension.
inline Eigen::MatrixXd ToColumns(const torch::Tensor& tensor) {
  const torch::Tensor values = tensor.detach().to(torch::kDouble).contiguous();
  int64_t num_rows = 1;
  for (int64_t i = 1; i < values.dim(); ++i) num_rows *= values.size(i);
  return Eigen::Map<const Eigen::MatrixXd>(
      values.data_ptr<double>(), num_rows, values.size(0));
}

// All entries, tensor after tensor.
inline Eigen::VectorXd Flatten(const std::vector<torch::Tensor>& tensors) {
  int64_t size = 0;
  for (const torch::Tensor& tensor : tensors) size += tensor.numel();
  Eigen::VectorXd vector(size);
  int64_t first = 0;
  for (const torch::Tensor& tensor : tensors) {
    vector.segment(first, tensor.numel()) =
        ToColumns(tensor.unsqueeze(0)).reshaped();
    first += tensor.numel();
  }
  return vector;
}

}  // namespace invgrad

#endif  // INVGRAD_TORCH_TORCH_TENSORS_H_
