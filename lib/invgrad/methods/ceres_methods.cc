#include "invgrad/methods/ceres_methods.h"

#include "ceres/types.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

// Ceres' options, and the names of those that Ceres has as enumerators, while a
// method's settings are read.
struct Draft {
  ceres::Solver::Options* options = nullptr;
  OptionSet set;
  // The most accurate solver, and fast enough for some hundred parameters.
  std::string linear_solver = "dense_qr";
  std::string dogleg = "traditional_dogleg";
  std::string conjugate_gradient = "fletcher_reeves";
  std::string line_search = "wolfe";
};

void DescribeTrustRegion(const std::vector<std::string>& linear_solvers,
                         Draft* draft) {
  // Without LAPACK, Ceres uses Eigen, compiled for the oldest processors.
  if (ceres::IsDenseLinearAlgebraLibraryTypeAvailable(ceres::LAPACK)) {
    draft->options->dense_linear_algebra_library_type = ceres::LAPACK;
  }
  draft->set.Add("initial_trust_region_radius",
                 &draft->options->initial_trust_region_radius,
                 {1e-32, 1e16},
                 "scaled length of the first step at most");
  draft->set.Add("use_nonmonotonic_steps",
                 &draft->options->use_nonmonotonic_steps,
                 "allow the cost to rise for a few steps");
  draft->set.Add("jacobi_scaling",
                 &draft->options->jacobi_scaling,
                 "scale the columns of J by their lengths at the start");
  draft->set.Add("use_inner_iterations",
                 &draft->options->use_inner_iterations,
                 "after each step, solve for blocks that no residual couples, "
                 "such as points");
  draft->set.Add(
      "linear_solver",
      &draft->linear_solver,
      linear_solvers,
      "how the step is computed; a Cholesky solver is faster and less "
      "accurate than dense_qr; schur is for bundle adjustment");
  draft->set.Add("num_threads",
                 &draft->options->num_threads,
                 {1, 1024},
                 "with more than one, runs differ in the last digits");
}

void DescribeLevenbergMarquardt(Draft* draft) {
  draft->options->trust_region_strategy_type = ceres::LEVENBERG_MARQUARDT;
  DescribeTrustRegion({"dense_qr",
                       "dense_normal_cholesky",
                       "sparse_normal_cholesky",
                       "dense_schur",
                       "sparse_schur",
                       "iterative_schur",
                       "cgnr"},
                      draft);
}

void DescribeDogleg(Draft* draft) {
  draft->options->trust_region_strategy_type = ceres::DOGLEG;
  draft->set.Add("dogleg",
                 &draft->dogleg,
                 {"traditional_dogleg", "subspace_dogleg"},
                 "the path, or the best step in the plane of both directions");
  // Ceres' dogleg requires an exact solver.
  DescribeTrustRegion({"dense_qr",
                       "dense_normal_cholesky",
                       "sparse_normal_cholesky",
                       "dense_schur",
                       "sparse_schur"},
                      draft);
}

// Quasi-Newton updates need the curvature condition of Wolfe's line search.
void DescribeBfgs(Draft* draft) {
  draft->options->line_search_direction_type = ceres::BFGS;
  draft->set.Add("use_approximate_eigenvalue_scaling",
                 &draft->options->use_approximate_eigenvalue_bfgs_scaling,
                 "start from a scaled inverse Hessian instead of the identity");
}

void DescribeLbfgs(Draft* draft) {
  draft->set.Add("rank",
                 &draft->options->max_lbfgs_rank,
                 {1, 1000},
                 "number of steps that are remembered");
  DescribeBfgs(draft);
  draft->options->line_search_direction_type = ceres::LBFGS;
}

void DescribeLineSearch(Draft* draft) {
  draft->set.Add("line_search",
                 &draft->line_search,
                 {"wolfe", "armijo"},
                 "its conditions");
}

void DescribeNonlinearCg(Draft* draft) {
  draft->options->line_search_direction_type =
      ceres::NONLINEAR_CONJUGATE_GRADIENT;
  draft->set.Add("type",
                 &draft->conjugate_gradient,
                 {"fletcher_reeves", "polak_ribiere", "hestenes_stiefel"},
                 "how the last direction enters the next");
  DescribeLineSearch(draft);
}

void DescribeSteepestDescent(Draft* draft) {
  draft->options->line_search_direction_type = ceres::STEEPEST_DESCENT;
  // The curvature condition needs more gradients and has no benefit here.
  draft->line_search = "armijo";
  DescribeLineSearch(draft);
}

// Sets the fields of Ceres' options that the method fixes, and describes the
// others.
using Describe = void (*)(Draft* draft);

CeresMethodRow Row(const std::string& name,
                   bool is_trust_region,
                   const std::string& formula,
                   Describe describe) {
  CeresMethodRow row;
  row.name = name;
  row.formula = formula;
  row.is_trust_region = is_trust_region;
  row.options = [describe] {
    ceres::Solver::Options options;
    Draft draft;
    draft.options = &options;
    describe(&draft);
    return draft.set.rows();
  };
  row.configure = [is_trust_region, describe](const Settings& settings,
                                              ceres::Solver::Options* options,
                                              std::string* error) {
    *options = ceres::Solver::Options();
    options->minimizer_type =
        is_trust_region ? ceres::TRUST_REGION : ceres::LINE_SEARCH;
    Draft draft;
    draft.options = options;
    describe(&draft);
    if (!draft.set.SetAll(settings, error)) return false;
    CHECK(ceres::StringToLinearSolverType(draft.linear_solver,
                                          &options->linear_solver_type));
    CHECK(ceres::StringToDoglegType(draft.dogleg, &options->dogleg_type));
    CHECK(ceres::StringToNonlinearConjugateGradientType(
        draft.conjugate_gradient, &options->nonlinear_conjugate_gradient_type));
    CHECK(ceres::StringToLineSearchType(draft.line_search,
                                        &options->line_search_type));
    return true;
  };
  return row;
}

}  // namespace

const std::vector<CeresMethodRow>& CeresMethods() {
  static const auto* const methods = new std::vector<CeresMethodRow>{
      Row("ceres_lm",
          true,
          "(J^T J + D^T D / mu) step = -J^T r",
          DescribeLevenbergMarquardt),
      Row("ceres_dogleg",
          true,
          "step on the path 0, Cauchy point, -J^+ r, where |D step| <= mu",
          DescribeDogleg),
      Row("ceres_bfgs",
          false,
          "step = -eta B J^T r, B ~ H^-1 by BFGS updates",
          DescribeBfgs),
      Row("ceres_lbfgs",
          false,
          "step = -eta B J^T r, B ~ H^-1 by the last BFGS updates",
          DescribeLbfgs),
      Row("ceres_nonlinear_cg",
          false,
          "step_k = eta d_k, d_k = -J^T r + beta d_{k-1}",
          DescribeNonlinearCg),
      Row("ceres_steepest_descent",
          false,
          "step = -eta J^T r, eta by line search",
          DescribeSteepestDescent),
  };
  return *methods;
}

const CeresMethodRow* FindCeresMethod(const std::string& name) {
  for (const CeresMethodRow& row : CeresMethods()) {
    if (row.name == name) return &row;
  }
  return nullptr;
}

}  // namespace invgrad
