#include "invgrad/chain/sample_error.h"

#include <cmath>

#include "fmt/core.h"

namespace invgrad {

bool SampleError(const DataSet& batch,
                 int sample,
                 const std::string& what,
                 std::string* error) {
  const bool is_point = batch.inputs.rows() == 0 && batch.batch_size() == 1;
  *error = is_point ? what
                    : fmt::format(
                          "sample {}: {}", batch.first_in_batch + sample, what);
  return false;
}

bool SimulatorError(const Simulator& simulator,
                    const Eigen::Map<const Eigen::MatrixXd>& x,
                    const DataSet& batch,
                    int sample,
                    std::string* error) {
  return SampleError(
      batch,
      sample,
      SimulatorFailure(
          simulator, x.col(sample).data(), batch.Context(sample).data()),
      error);
}

bool CheckCost(double cost, std::string* error) {
  if (std::isfinite(cost)) return true;
  *error = "the cost of the batch is not finite";
  return false;
}

bool CheckDerivatives(const Eigen::VectorXd& gradient,
                      const Eigen::MatrixXd& hessian,
                      std::string* error) {
  if (gradient.allFinite() && hessian.allFinite()) return true;
  *error = "a derivative in the weights is not finite";
  return false;
}

}  // namespace invgrad
