#include <cmath>
#include <utility>

#include "fmt/core.h"
#include "invgrad/data.h"
#include "invgrad/internal/logging.h"

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
    CHECK_EQ(array.cols(), data.num_samples())
        << "inputs, contexts, targets and solutions have a column a sample.";
    return columns(array);
  };
  return {take(data.inputs),
          take(data.contexts),
          take(data.targets),
          take(data.solutions)};
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

DataSet DataSet::Piece(int first, int count) const {
  DataSet piece = Range(first, count);
  piece.first_in_batch = first_in_batch + first;
  piece.piece_of = batch_size();
  return piece;
}

bool DataSet::IsFinite(std::string* error) const {
  const std::pair<const char*, const MatrixXd&> arrays[] = {
      {"inputs", inputs},
      {"contexts", contexts},
      {"targets", targets},
      {"solutions", solutions}};
  for (const auto& [name, array] : arrays) {
    for (Eigen::Index i = 0; i < array.size(); ++i) {
      const double value = array.data()[i];
      if (std::isfinite(value)) continue;
      *error = fmt::format("{}: entry {} of sample {} is {}",
                           name,
                           i % array.rows(),
                           i / array.rows(),
                           value);
      return false;
    }
  }
  return true;
}

}  // namespace invgrad
