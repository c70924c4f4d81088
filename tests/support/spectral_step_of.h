// A spectral step of a dense J, for tests.
#ifndef TESTS_SUPPORT_SPECTRAL_STEP_OF_H_
#define TESTS_SUPPORT_SPECTRAL_STEP_OF_H_

#include <limits>

#include "gtest/gtest.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/spectral.h"
#include "invgrad/stored_jacobian.h"
#include "tests/support/spectral_reference.h"

namespace invgrad {

// `route` whatever its accuracy; auto with the default tolerances.
inline SpectralStepOptions Take(SpectralRoute route) {
  SpectralStepOptions options;
  options.route = route;
  if (route != SpectralRoute::kAuto) {
    options.tolerance = std::numeric_limits<double>::infinity();
    options.threshold_tolerance = std::numeric_limits<double>::infinity();
  }
  return options;
}

inline Eigen::VectorXd StepOf(const Eigen::MatrixXd& J,
                              const Eigen::VectorXd& g,
                              const SpectralFilter& filter,
                              SpectralRoute route,
                              SpectralStepSummary* summary) {
  Eigen::VectorXd d = Eigen::VectorXd::Zero(J.cols());
  EXPECT_TRUE(
      SpectralStep(DenseJacobian(J), g, filter, Take(route), &d, summary))
      << SpectralRouteName(route) << ": " << summary->message;
  EXPECT_EQ(d.size(), J.cols());
  return d;
}

inline constexpr SpectralRoute kBothRoutes[] = {SpectralRoute::kSvd,
                                                SpectralRoute::kGram};

// |d - exact| / |exact|
inline double Distance(const Eigen::VectorXd& d, const LongVector& exact) {
  return static_cast<double>((d.cast<long double>() - exact).norm() /
                             exact.norm());
}

}  // namespace invgrad

#endif  // TESTS_SUPPORT_SPECTRAL_STEP_OF_H_
