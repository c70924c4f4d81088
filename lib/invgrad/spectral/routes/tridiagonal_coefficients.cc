#include "invgrad/spectral/routes/tridiagonal_coefficients.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::Index;
using Eigen::VectorXd;

bool TridiagonalCoefficients(VectorXd off_diagonal,
                             VectorXd* lambda,
                             VectorXd* c) {
  constexpr int kMaxIterations = 50;  // for one eigenvalue
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  VectorXd& d = *lambda;
  VectorXd& e = off_diagonal;
  const Index size = d.size();
  CHECK_EQ(c->size(), size);
  CHECK_EQ(e.size(), size - 1);
  const double largest =
      std::max(d.lpNorm<Eigen::Infinity>(), e.lpNorm<Eigen::Infinity>());
  // Far below rounding, and its square does not underflow.
  const double tiny = std::pow(kEpsilon, 3) * largest;
  // Whether T is, up to rounding, two matrices: before and after row i + 1.
  const auto splits = [&](Index i) {
    return std::abs(e[i]) <=
           kEpsilon * std::max(std::abs(d[i]) + std::abs(d[i + 1]),
                               kEpsilon * largest);
  };
  for (Index first = 0; first < size; ++first) {
    for (int iteration = 0;; ++iteration) {
      Index last = first;
      while (last + 1 < size && !splits(last)) ++last;
      if (last == first) break;  // d[first] is an eigenvalue
      if (iteration == kMaxIterations) return false;
      // Wilkinson's shift: the eigenvalue of the leading 2 x 2 block that is
      // nearer to d[first].
      const double half = 0.5 * (d[first + 1] - d[first]) / e[first];
      const double root = std::hypot(half, 1.0);
      double g =
          d[last] - d[first] + e[first] / (half + std::copysign(root, half));
      double sine = 1.0;
      double cosine = 1.0;
      double p = 0.0;
      Index i = last - 1;
      for (; i >= first; --i) {
        const double f = sine * e[i];
        const double b = cosine * e[i];
        const double r = std::sqrt(f * f + g * g);
        if (i + 1 < last) e[i + 1] = r;
        if (r <= tiny) {
          // T has split at row i + 1.
          d[i + 1] -= p;
          break;
        }
        const double inverse = 1.0 / r;
        sine = f * inverse;
        cosine = g * inverse;
        g = d[i + 1] - p;
        const double t = (d[i] - g) * sine + 2.0 * cosine * b;
        p = sine * t;
        d[i + 1] = g + p;
        g = cosine * t - b;
        const double upper = (*c)[i + 1];
        (*c)[i + 1] = sine * (*c)[i] + cosine * upper;
        (*c)[i] = cosine * (*c)[i] - sine * upper;
      }
      if (i >= first) {
        if (last < size - 1) e[last] = 0.0;
        continue;
      }
      d[first] -= p;
      e[first] = g;
      if (last < size - 1) e[last] = 0.0;
    }
  }
  return true;
}

}  // namespace invgrad
