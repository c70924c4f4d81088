#include "invgrad/internal/communicator.h"

#include <algorithm>

#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Share Communicator::ShareOf(int total, int r) const {
  const auto bound = [&](int k) {
    return static_cast<int>(static_cast<long>(total) * k / size());
  };
  return {bound(r), bound(r + 1) - bound(r)};
}

std::vector<std::ptrdiff_t> Communicator::SharedSizes(
    int total, std::ptrdiff_t per_item) const {
  std::vector<std::ptrdiff_t> sizes(size());
  for (int r = 0; r < size(); ++r) {
    sizes[r] = per_item * ShareOf(total, r).count;
  }
  return sizes;
}

MatrixXd Communicator::GatherColumns(const MatrixXd& own,
                                     int total,
                                     int per_item) const {
  const Index num_columns = Index{per_item} * total;
  CHECK_EQ(own.cols(), Index{per_item} * OwnShare(total).count);
  MatrixXd all(own.rows(), num_columns);
  Gather(own.data(), SharedSizes(total, own.rows() * per_item), all.data());
  return all;
}

std::vector<std::string> Communicator::GatherTexts(
    const std::string& own) const {
  // A character is a number here: texts are short and rare.
  VectorXd lengths = VectorXd::Zero(size());
  lengths[rank()] = static_cast<double>(own.size());
  Sum(lengths.data(), lengths.size());
  std::vector<std::ptrdiff_t> sizes(lengths.begin(), lengths.end());
  const std::vector<double> characters(own.begin(), own.end());
  VectorXd all(static_cast<Index>(lengths.sum()));
  Gather(characters.data(), sizes, all.data());
  std::vector<std::string> texts;
  Index first = 0;
  for (const std::ptrdiff_t length : sizes) {
    std::string& text = texts.emplace_back();
    for (const double c : all.segment(first, length)) {
      text += static_cast<char>(c);
    }
    first += length;
  }
  return texts;
}

bool Communicator::Agree(bool ok, std::string* error) const {
  double num_failures = ok ? 0.0 : 1.0;
  Sum(&num_failures, 1);
  if (num_failures == 0.0) return true;
  // An empty text stands for yes.
  const std::vector<std::string> texts = GatherTexts(ok               ? ""
                                                     : error->empty() ? "failed"
                                                                      : *error);
  *error = *std::find_if(texts.begin(), texts.end(), [](const auto& text) {
    return !text.empty();
  });
  return false;
}

}  // namespace invgrad
