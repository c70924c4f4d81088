#include "invgrad/methods/ceres_methods.h"

#include "ceres/types.h"
#include "glog/logging.h"

namespace invgrad {
namespace {

using CeresOptions = ceres::Solver::Options;

// The options that Ceres has as enumerators.
struct Names {
  // The most accurate solver, and fast enough for some hundred parameters.
  std::string linear_solver = "dense_qr";
  std::string dogleg = "traditional_dogleg";
  std::string conjugate_gradient = "fletcher_reeves";
  std::string line_search = "wolfe";
};

void DescribeTrustRegion(const std::vector<std::string>& linear_solvers,
                         CeresOptions* options,
                         Names* names,
                         OptionSet* set) {
  // Without LAPACK, Ceres uses Eigen, compiled for the oldest processors.
  if (ceres::IsDenseLinearAlgebraLibraryTypeAvailable(ceres::LAPACK)) {
    options->dense_linear_algebra_library_type = ceres::LAPACK;
  }
  set->Add("initial_trust_region_radius",
           &options->initial_trust_region_radius,
           {1e-32, 1e16},
           "scaled length of the first step at most");
  set->Add("use_nonmonotonic_steps",
           &options->use_nonmonotonic_steps,
           "allow the cost to rise for a few steps");
  set->Add("linear_solver",
           &names->linear_solver,
           linear_solvers,
           "how the step is computed; a Cholesky solver is faster and less "
           "accurate than dense_qr; schur is for bundle adjustment");
  set->Add("num_threads",
           &options->num_threads,
           {1, 1024},
           "with more than one, runs differ in the last digits");
}

void DescribeLevenbergMarquardt(CeresOptions* options,
                                Names* names,
                                OptionSet* set) {
  options->trust_region_strategy_type = ceres::LEVENBERG_MARQUARDT;
  DescribeTrustRegion({"dense_qr",
                       "dense_normal_cholesky",
                       "sparse_normal_cholesky",
                       "dense_schur",
                       "sparse_schur",
                       "iterative_schur",
                       "cgnr"},
                      options,
                      names,
                      set);
}

void DescribeDogleg(CeresOptions* options, Names* names, OptionSet* set) {
  options->trust_region_strategy_type = ceres::DOGLEG;
  set->Add("dogleg",
           &names->dogleg,
           {"traditional_dogleg", "subspace_dogleg"},
           "the path, or the best step in the plane of both directions");
  // Ceres' dogleg requires an exact solver.
  DescribeTrustRegion({"dense_qr",
                       "dense_normal_cholesky",
                       "sparse_normal_cholesky",
                       "dense_schur",
                       "sparse_schur"},
                      options,
                      names,
                      set);
}

// Quasi-Newton updates need the curvature condition of Wolfe's line search.
void DescribeBfgs(CeresOptions* options, Names* /*names*/, OptionSet* set) {
  options->line_search_direction_type = ceres::BFGS;
  set->Add("use_approximate_eigenvalue_scaling",
           &options->use_approximate_eigenvalue_bfgs_scaling,
           "start from a scaled inverse Hessian instead of the identity");
}

void DescribeLbfgs(CeresOptions* options, Names* names, OptionSet* set) {
  set->Add("rank",
           &options->max_lbfgs_rank,
           {1, 1000},
           "number of steps that are remembered");
  DescribeBfgs(options, names, set);
  options->line_search_direction_type = ceres::LBFGS;
}

void DescribeLineSearch(Names* names, OptionSet* set) {
  set->Add("line_search",
           &names->line_search,
           {"wolfe", "armijo"},
           "its conditions");
}

void DescribeNonlinearCg(CeresOptions* options, Names* names, OptionSet* set) {
  options->line_search_direction_type = ceres::NONLINEAR_CONJUGATE_GRADIENT;
  set->Add("type",
           &names->conjugate_gradient,
           {"fletcher_reeves", "polak_ribiere", "hestenes_stiefel"},
           "how the last direction enters the next");
  DescribeLineSearch(names, set);
}

void DescribeSteepestDescent(CeresOptions* options,
                             Names* names,
                             OptionSet* set) {
  options->line_search_direction_type = ceres::STEEPEST_DESCENT;
  // The curvature condition needs more gradients and has no benefit here.
  names->line_search = "armijo";
  DescribeLineSearch(names, set);
}

// Sets the fields of Ceres' options that the method fixes, and describes the
// others.
using Describe = void (*)(CeresOptions* options, Names* names, OptionSet* set);

CeresMethodRow Row(const std::string& name,
                   bool is_trust_region,
                   const std::string& formula,
                   Describe describe) {
  CeresMethodRow row;
  row.name = name;
  row.formula = formula;
  row.is_trust_region = is_trust_region;
  row.options = [describe] {
    CeresOptions options;
    Names names;
    OptionSet set;
    describe(&options, &names, &set);
    return set.rows();
  };
  row.configure = [is_trust_region, describe](const Settings& settings,
                                              CeresOptions* options,
                                              std::string* error) {
    *options = CeresOptions();
    options->minimizer_type =
        is_trust_region ? ceres::TRUST_REGION : ceres::LINE_SEARCH;
    Names names;
    OptionSet set;
    describe(options, &names, &set);
    if (!set.SetAll(settings, error)) return false;
    CHECK(ceres::StringToLinearSolverType(names.linear_solver,
                                          &options->linear_solver_type));
    CHECK(ceres::StringToDoglegType(names.dogleg, &options->dogleg_type));
    CHECK(ceres::StringToNonlinearConjugateGradientType(
        names.conjugate_gradient, &options->nonlinear_conjugate_gradient_type));
    CHECK(ceres::StringToLineSearchType(names.line_search,
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
