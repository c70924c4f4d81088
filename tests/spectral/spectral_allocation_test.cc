// The second step, and the second tridiagonalization, of a shape allocate
// nothing.
#include <utility>

#include "gtest/gtest.h"
#include "invgrad/internal/blas.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/spectral.h"
#include "invgrad/spectral/routes/tridiagonalization.h"
#include "invgrad/stored_jacobian.h"
#include "tests/support/count_allocations.h"
#include "tests/support/spectral_reference.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST(SpectralAllocation, CountsThoseOfEigenAndOfNew) {
  if (!CountsAllocations()) GTEST_SKIP() << "the sanitizer owns malloc";
  VectorXd x;
  EXPECT_EQ(CountAllocations([&] { x.resize(100); }), 1);
  EXPECT_EQ(x.size(), 100);
  // Volatile: the compiler may leave out what nobody reads.
  int* volatile number = nullptr;
  EXPECT_EQ(CountAllocations([&] { number = new int(3); }), 1);
  delete number;
}

TEST(SpectralAllocation, AWarmStepByTheGramRouteHasNone) {
  if (!CountsAllocations()) GTEST_SKIP() << "the sanitizer owns malloc";
  RandomMatrices random(1);
  for (const auto& [m, n] : {std::pair(64, 90), std::pair(130, 200)}) {
    const DenseJacobian first(random.WithSpectrum(m, n, LogUniform(m, 1e-2)));
    const DenseJacobian second(random.WithSpectrum(m, n, LogUniform(m, 1e-3)));
    const VectorXd g = random.Vector(m);
    for (const SpectralRoute route :
         {SpectralRoute::kGram, SpectralRoute::kAuto}) {
      for (const SpectralFilter& filter :
           {SpectralFilter::HalfInverse(0.2),
            SpectralFilter::GaussNewton(1e-6),
            SpectralFilter::LevenbergMarquardt(0.0, 1e-4)}) {
        SpectralStepOptions options;
        options.route = route;
        SpectralWorkspace workspace;
        SpectralStepSummary summary;
        VectorXd d;
        // The number of the quadrature's nodes is the spectrum's: twice.
        for (int warm_up = 0; warm_up < 2; ++warm_up) {
          ASSERT_TRUE(SpectralStep(
              second, g, filter, options, &workspace, &d, &summary));
          ASSERT_TRUE(SpectralStep(
              first, g, filter, options, &workspace, &d, &summary));
        }
        EXPECT_EQ(CountAllocations([&] {
                    SpectralStep(
                        second, g, filter, options, &workspace, &d, &summary);
                  }),
                  0)
            << SpectralRouteName(route) << " " << m;
        EXPECT_EQ(summary.route, SpectralRoute::kGram);
      }
    }
  }
}

TEST(SpectralAllocation, ASecondTridiagonalizationHasNone) {
  if (!CountsAllocations()) GTEST_SKIP() << "the sanitizer owns malloc";
  RandomMatrices random(1);
  const MatrixXd A = random.WithSpectrum(260, 260, LogUniform(260, 1e-3));
  const MatrixXd K = A * A.transpose();
  for (const auto method : {Tridiagonalization::Method::kAuto,
                            Tridiagonalization::Method::kOneStage,
                            Tridiagonalization::Method::kTwoStage}) {
    MatrixXd reflectors = K;
    VectorXd x = K.col(0);
    Tridiagonalization reduction;
    const auto compute = [&] { reduction.Compute(&reflectors, method); };
    EXPECT_GT(CountAllocations(compute), 0);
    reflectors = K;
    EXPECT_EQ(CountAllocations([&] {
                compute();
                reduction.ApplyQTranspose(&x);
                reduction.ApplyQ(&x);
              }),
              0);
  }
}

}  // namespace
}  // namespace invgrad
