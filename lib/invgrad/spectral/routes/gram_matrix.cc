#include "invgrad/spectral/routes/gram_matrix.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "invgrad/core/shared_jacobian.h"
#include "invgrad/spectral/routes/spectral_routes.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// If the largest diagonal entry of the Gram matrix is below this, singular
// values above epsilon s_max underflow.
constexpr double kSmallestGram = 1e-270;

}  // namespace

bool SmallerGram(const JacobianOperator& J,
                 const ColumnStrips& strips,
                 MatrixXd* K,
                 VectorXd* diagonal,
                 double* unit,
                 std::string* message) {
  const bool is_parameter_side = J.cols() < J.rows();
  if (strips.communicator() != nullptr) {
    const SharedJacobian& shared = *SharedRowsOf(J);
    if (is_parameter_side) {
      shared.ParameterGramStrips(strips, K);
    } else {
      shared.GramStrips(strips, K);
    }
  } else if (is_parameter_side) {
    J.ParameterGram(K);
  } else {
    J.Gram(K);
  }
  // A diagonal entry is the squared norm of a row or column of J. It is not
  // finite if an entry of this row or column is not finite, or if a square
  // overflows.
  strips.GetDiagonal(*K, diagonal);
  if (!diagonal->allFinite()) {
    if (CheckJacobianFinite(J, message)) {
      *message = "the squares of J's entries overflow";
    }
    return false;
  }
  const double largest = diagonal->maxCoeff();
  if (largest < kSmallestGram) {
    *unit = 0.0;
    return true;
  }
  // Entries of ordinary size need no scaling, which saves a pass.
  int exponent = 0;
  std::frexp(largest, &exponent);
  if (std::abs(exponent) <= 100) exponent = 0;
  *unit = std::ldexp(1.0, exponent);
  if (exponent != 0) {
    const Index size = diagonal->size();
    strips.ForOwn([&](Index first, Index count) {
      K->block(first, strips.Local(first), size - first, count) *= 1.0 / *unit;
    });
  }
  return true;
}

double GramResolution(Index m, Index n) {
  const auto size = static_cast<double>(std::min(m, n));
  const auto other_size = static_cast<double>(std::max(m, n));
  return 2.0 * std::numeric_limits<double>::epsilon() *
         (size + std::sqrt(other_size));
}

}  // namespace invgrad
