#include "invgrad/rank/largest_singular_value.h"

#include <lapacke.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "Eigen/Core"
#include "glog/logging.h"

namespace invgrad {
namespace {

// A start vector without symmetries, so that it is unlikely to be orthogonal to
// a singular vector. The same for every call.
Eigen::VectorXd StartVector(Eigen::Index size) {
  Eigen::VectorXd v(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    v[i] = 1.0 + 0.5 * std::sin(1.7 * static_cast<double>(i + 1));
  }
  return v.normalized();
}

double LargestEigenvalue(std::vector<double> diagonal,
                         std::vector<double> off_diagonal) {
  const auto size = static_cast<lapack_int>(diagonal.size());
  CHECK_EQ(LAPACKE_dsterf(size, diagonal.data(), off_diagonal.data()), 0);
  return diagonal.back();
}

}  // namespace

double LargestSingularValue(const JacobianOperator& J, double tolerance) {
  constexpr int kMaxSteps = 100;
  constexpr int kStepsBetweenTests = 8;
  std::vector<double> diagonal;
  std::vector<double> off_diagonal;
  Eigen::VectorXd v = StartVector(J.cols());
  Eigen::VectorXd previous = Eigen::VectorXd::Zero(J.cols());
  Eigen::VectorXd product;
  Eigen::VectorXd w;
  double beta = 0.0;
  double largest = 0.0;
  const int max_steps = std::min(kMaxSteps, J.cols());
  for (int step = 1; step <= max_steps; ++step) {
    J.Times(v, &product);
    J.TransposeTimes(product, &w);
    const double alpha = v.dot(w);
    if (!std::isfinite(alpha)) return std::numeric_limits<double>::quiet_NaN();
    diagonal.push_back(alpha);
    w -= alpha * v + beta * previous;
    beta = w.norm();
    // The Krylov space is invariant.
    const bool is_exhausted =
        beta <= std::numeric_limits<double>::epsilon() * alpha;
    if (step % kStepsBetweenTests == 0 || step == max_steps || is_exhausted) {
      const double last = largest;
      largest = LargestEigenvalue(diagonal, off_diagonal);
      if (is_exhausted || largest - last <= 2.0 * tolerance * largest) break;
    }
    off_diagonal.push_back(beta);
    previous = v;
    v = w / beta;
  }
  return std::sqrt(std::max(largest, 0.0));
}

}  // namespace invgrad
