#include "invgrad/chain/data_set.h"

#include <cmath>

#include "fmt/core.h"
#include "glog/logging.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;

// columns(array) of all arrays, each with `count` columns.
template <typename Columns>
DataSet TakeColumns(const DataSet& data,
                    Eigen::Index count,
                    const Columns& columns) {
  const auto take = [&](const MatrixXd& array) -> MatrixXd {
    // An array without rows may have no columns.
    if (array.rows() == 0) return MatrixXd(0, count);
    CHECK_EQ(array.cols(), data.num_samples());
    return columns(array);
  };
  return {take(data.inputs),
          take(data.contexts),
          take(data.targets),
          take(data.solutions)};
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
  for (const int index : indices) {
    CHECK_GE(index, 0);
    CHECK_LT(index, num_samples());
  }
  const auto count = static_cast<Eigen::Index>(indices.size());
  return TakeColumns(*this, count, [&](const MatrixXd& array) {
    MatrixXd selected(array.rows(), count);
    for (Eigen::Index k = 0; k < count; ++k) {
      selected.col(k) = array.col(indices[k]);
    }
    return selected;
  });
}

DataSet DataSet::Range(int first, int count) const {
  CHECK_GE(first, 0);
  CHECK_GE(count, 0);
  CHECK_LE(count, num_samples() - first);
  return TakeColumns(*this, count, [&](const MatrixXd& array) {
    return MatrixXd(array.middleCols(first, count));
  });
}

bool DataSet::IsFinite(std::string* error) const {
  return IsArrayFinite("inputs", inputs, error) &&
         IsArrayFinite("contexts", contexts, error) &&
         IsArrayFinite("targets", targets, error) &&
         IsArrayFinite("solutions", solutions, error);
}

}  // namespace invgrad
