// A step of the same shape by the same Gram route allocates nothing. Its own
// executable, because it counts every allocation of the process.
#include <cstddef>
#include <utility>

#include "bin/support/spectral_reference.h"
#include "gtest/gtest.h"
#include "invgrad/spectral/spectral_step.h"

namespace {

// Of this thread: BLAS and the test framework may do on others what they like.
thread_local long num_allocations = 0;

}  // namespace

#if defined(__SANITIZE_ADDRESS__) || !defined(__GLIBC__)
#define INVGRAD_COUNTS_MALLOC 0
#else
#define INVGRAD_COUNTS_MALLOC 1
// Whatever allocates in a program with glibc ends in one of these.
extern "C" {
// glibc's own names.
// NOLINTBEGIN(bugprone-reserved-identifier)
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
// NOLINTEND(bugprone-reserved-identifier)

void* malloc(std::size_t size) {
  ++num_allocations;
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  ++num_allocations;
  return __libc_calloc(count, size);
}
void* realloc(void* memory, std::size_t size) {
  ++num_allocations;
  return __libc_realloc(memory, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  ++num_allocations;
  return __libc_memalign(alignment, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  ++num_allocations;
  return __libc_memalign(alignment, size);
}
}
#endif

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST(SpectralAllocation, CountsThoseOfEigenAndOfNew) {
  if (!INVGRAD_COUNTS_MALLOC) GTEST_SKIP() << "the sanitizer owns malloc";
  // Volatile: the compiler may leave out what nobody looks at.
  VectorXd x;
  const volatile long before = num_allocations;
  x.resize(100);
  const volatile long with_eigen = num_allocations;
  int* const volatile number = new int(3);
  const volatile long with_new = num_allocations;
  delete number;
  EXPECT_EQ(with_eigen - before, 1);
  EXPECT_EQ(with_new - with_eigen, 1);
  EXPECT_EQ(x.size(), 100);
}

TEST(SpectralAllocation, AWarmStepByTheGramRouteHasNone) {
  if (!INVGRAD_COUNTS_MALLOC) GTEST_SKIP() << "the sanitizer owns malloc";
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
        const long before = num_allocations;
        SpectralStep(second, g, filter, options, &workspace, &d, &summary);
        EXPECT_EQ(num_allocations - before, 0)
            << SpectralRouteName(route) << " " << m;
        EXPECT_EQ(summary.route, SpectralRoute::kGram);
      }
    }
  }
}

}  // namespace
}  // namespace invgrad
