// Which shared libraries the linker chose: one BLAS serves Ceres, LAPACKE and
// us, and it is OpenBLAS. Any other would give right answers, slowly.
#include <dlfcn.h>
#include <lapacke.h>
#include <link.h>

#include <string>
#include <vector>

#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"

namespace invgrad {
namespace linked_libraries_test {

// The file that defines `symbol` for the whole process; empty if none does.
std::string DefiningLibrary(const char* symbol) {
  void* address = dlsym(RTLD_DEFAULT, symbol);
  Dl_info info;
  if (address == nullptr || dladdr(address, &info) == 0) return "";
  return info.dli_fname;
}

std::vector<std::string> LoadedLibraries() {
  std::vector<std::string> names;
  dl_iterate_phdr(
      [](dl_phdr_info* info, size_t, void* result) {
        static_cast<std::vector<std::string>*>(result)->push_back(
            info->dlpi_name);
        return 0;
      },
      &names);
  return names;
}

TEST(LinkedLibraries, BlasAndLapackAreThoseOfOpenBlas) {
  for (const char* symbol : {"dgemm_", "cblas_dgemm", "dsyevd_", "dgesdd_"}) {
    EXPECT_NE(DefiningLibrary(symbol).find("libopenblas"), std::string::npos)
        << symbol << " is in '" << DefiningLibrary(symbol) << "'";
  }
}

// Debian's Ceres names libf77blas, a part of ATLAS, among what it links.
TEST(LinkedLibraries, CeresDoesNotBringAtlas) {
  for (const std::string& name : LoadedLibraries()) {
    EXPECT_EQ(name.find("libf77blas"), std::string::npos) << name;
  }
}

TEST(LinkedLibraries, LapackeFindsEigenvalues) {
  double matrix[] = {2.0, 1.0, 1.0, 2.0};
  double eigenvalues[2];
  ASSERT_EQ(
      LAPACKE_dsyevd(LAPACK_COL_MAJOR, 'N', 'L', 2, matrix, 2, eigenvalues), 0);
  // An eigenvalue is exact to a few eps |matrix|.
  EXPECT_NEAR(eigenvalues[0], 1.0, 1e-15 * 10);
  EXPECT_NEAR(eigenvalues[1], 3.0, 1e-15 * 10);
}

struct TenMinusX {
  template <typename T>
  bool operator()(const T* x, T* residual) const {
    residual[0] = 10.0 - x[0];
    return true;
  }
};

TEST(LinkedLibraries, CeresSolvesThroughLapack) {
  double x = 0.5;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<TenMinusX, 1, 1>(new TenMinusX),
      nullptr,
      &x);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.dense_linear_algebra_library_type = ceres::LAPACK;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE)
      << summary.FullReport();
  EXPECT_NEAR(x, 10.0, 1e-6);
}

}  // namespace linked_libraries_test
}  // namespace invgrad
