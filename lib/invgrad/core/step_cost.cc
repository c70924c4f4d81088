#include "invgrad/core/step_cost.h"

#include <algorithm>

namespace invgrad {

namespace {

// Of a sparse factorization for each entry of J: about an iteration of Ceres
// (work_limit.cc), which also factorizes.
constexpr double kOperationsOfEntry = 500.0;
constexpr double kBytesOfEntry = 100.0;

bool IsSparse(const LinearizationParts& needs, double num_entries) {
  return needs.factorization && needs.uses_sparsity && num_entries > 0.0;
}

double GramSize(const LinearizationParts& needs, double rows, double cols) {
  return needs.by_parameter_gram ? cols : std::min(rows, cols);
}

}  // namespace

double StepOperations(const LinearizationParts& needs,
                      double rows,
                      double cols,
                      double num_entries) {
  if (needs.hessian) return 10.0 * cols * cols * cols;
  if (IsSparse(needs, num_entries)) return kOperationsOfEntry * num_entries;
  if (needs.factorization) {
    const double k = GramSize(needs, rows, cols);
    const double of_gram = needs.by_cholesky ? 0.5 : 10.0;
    return k * k * (rows + cols - k + of_gram * k);
  }
  if (num_entries == 0.0) return 0.0;
  // An iteration, with a product each way, ends after k.
  return std::min(1.0 * needs.num_products, 2.0 * std::min(rows, cols)) *
         (12.0 * num_entries + 25.0 * cols);
}

double MatrixBytes(const LinearizationParts& needs, double cols) {
  return sizeof(double) * needs.num_squares * cols * cols;
}

std::vector<MemoryPart> StepMemory(const LinearizationParts& needs,
                                   double rows,
                                   double cols,
                                   double num_entries,
                                   int num_ranks) {
  constexpr double kDouble = sizeof(double);
  constexpr double kNumVectors = 6.0;
  std::vector<MemoryPart> parts = {
      {"vectors of weights", kNumVectors * kDouble * cols}};
  if (needs.hessian) {
    // With LAPACK's workspace.
    parts.push_back(
        {"Hessian and its factorization", 4.0 * kDouble * cols * cols});
  }
  if (needs.num_squares > 0) {
    parts.push_back({"matrices of the rule", MatrixBytes(needs, cols)});
  }
  if (IsSparse(needs, num_entries)) {
    parts.push_back({"J^T J and its factor, if they are sparse",
                     kBytesOfEntry * num_entries});
  } else if (needs.factorization) {
    const double k = GramSize(needs, rows, cols);
    parts.push_back({"Gram matrix and its factorization",
                     2.0 * kDouble * k * k / num_ranks});
    if (cols < rows) {
      parts.push_back({"J", kDouble * rows * cols / num_ranks});
    }
  }
  return parts;
}

}  // namespace invgrad
