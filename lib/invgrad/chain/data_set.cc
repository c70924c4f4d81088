#include "invgrad/chain/data_set.h"

#include <cmath>

#include "fmt/core.h"
#include "glog/logging.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;

// An array without rows may have no columns.
void CheckColumns(const MatrixXd& array, int num_samples) {
  if (array.rows() > 0) CHECK_EQ(array.cols(), num_samples);
}

MatrixXd SelectColumns(const MatrixXd& array, const std::vector<int>& indices) {
  MatrixXd selected(array.rows(), static_cast<Eigen::Index>(indices.size()));
  if (array.rows() == 0) return selected;
  Eigen::Index column = 0;
  for (const int index : indices) selected.col(column++) = array.col(index);
  return selected;
}

MatrixXd ColumnRange(const MatrixXd& array, int first, int count) {
  if (array.rows() == 0) return MatrixXd(0, count);
  return array.middleCols(first, count);
}

bool IsArrayFinite(const char* name,
                   const MatrixXd& array,
                   std::string* error) {
  if (array.allFinite()) return true;
  for (Eigen::Index sample = 0; sample < array.cols(); ++sample) {
    for (Eigen::Index entry = 0; entry < array.rows(); ++entry) {
      if (std::isfinite(array(entry, sample))) continue;
      *error = fmt::format("{}: entry {} of sample {} is {}",
                           name,
                           entry,
                           sample,
                           array(entry, sample));
      return false;
    }
  }
  return true;
}

}  // namespace

DataSet DataSet::Select(const std::vector<int>& indices) const {
  CheckColumns(contexts, num_samples());
  CheckColumns(targets, num_samples());
  CheckColumns(solutions, num_samples());
  for (const int index : indices) {
    CHECK_GE(index, 0);
    CHECK_LT(index, num_samples());
  }
  return {SelectColumns(inputs, indices),
          SelectColumns(contexts, indices),
          SelectColumns(targets, indices),
          SelectColumns(solutions, indices)};
}

DataSet DataSet::Range(int first, int count) const {
  CheckColumns(contexts, num_samples());
  CheckColumns(targets, num_samples());
  CheckColumns(solutions, num_samples());
  CHECK_GE(first, 0);
  CHECK_GE(count, 0);
  CHECK_LE(count, num_samples() - first);
  return {ColumnRange(inputs, first, count),
          ColumnRange(contexts, first, count),
          ColumnRange(targets, first, count),
          ColumnRange(solutions, first, count)};
}

bool DataSet::IsFinite(std::string* error) const {
  return IsArrayFinite("inputs", inputs, error) &&
         IsArrayFinite("contexts", contexts, error) &&
         IsArrayFinite("targets", targets, error) &&
         IsArrayFinite("solutions", solutions, error);
}

}  // namespace invgrad
