#include "invgrad/methods/ceres_methods.h"

#include <algorithm>

#include "ceres/types.h"
#include "glog/logging.h"

namespace invgrad {
namespace {

// The options of a family of methods: Describe declares them, and Apply writes
// them to Ceres' options.

struct TrustRegionOptions {
  double initial_trust_region_radius = 1e4;
  bool use_nonmonotonic_steps = false;
  // The most accurate solver, and fast enough for some hundred parameters.
  std::string linear_solver = "dense_qr";
  int num_threads = 1;

  void Describe(const std::vector<std::string>& linear_solvers,
                OptionSet* set) {
    set->Add("initial_trust_region_radius",
             &initial_trust_region_radius,
             {1e-32, 1e16},
             "scaled length of the first step at most");
    set->Add("use_nonmonotonic_steps",
             &use_nonmonotonic_steps,
             "allow the cost to rise for a few steps");
    set->Add("linear_solver",
             &linear_solver,
             linear_solvers,
             "how the step is computed; a Cholesky solver is faster and less "
             "accurate than dense_qr; schur is for bundle adjustment");
    set->Add("num_threads",
             &num_threads,
             {1, 1024},
             "with more than one, runs differ in the last digits");
  }

  void Apply(ceres::Solver::Options* options) const {
    options->minimizer_type = ceres::TRUST_REGION;
    options->initial_trust_region_radius = initial_trust_region_radius;
    options->use_nonmonotonic_steps = use_nonmonotonic_steps;
    options->num_threads = num_threads;
    CHECK(ceres::StringToLinearSolverType(linear_solver,
                                          &options->linear_solver_type));
    // Without LAPACK, Ceres uses Eigen, compiled for the oldest processors.
    if (ceres::IsDenseLinearAlgebraLibraryTypeAvailable(ceres::LAPACK)) {
      options->dense_linear_algebra_library_type = ceres::LAPACK;
    }
  }
};

struct LevenbergMarquardtOptions {
  TrustRegionOptions trust_region;

  void Describe(OptionSet* set) {
    trust_region.Describe({"dense_qr",
                           "dense_normal_cholesky",
                           "sparse_normal_cholesky",
                           "dense_schur",
                           "sparse_schur",
                           "iterative_schur",
                           "cgnr"},
                          set);
  }

  void Apply(
      ceres::Solver::Options* options,
      ceres::GradientProblemSolver::Options* /*gradient_options*/) const {
    trust_region.Apply(options);
    options->trust_region_strategy_type = ceres::LEVENBERG_MARQUARDT;
  }
};

struct DoglegOptions {
  TrustRegionOptions trust_region;
  std::string dogleg = "traditional_dogleg";

  void Describe(OptionSet* set) {
    set->Add("dogleg",
             &dogleg,
             {"traditional_dogleg", "subspace_dogleg"},
             "the path, or the best step in the plane of both directions");
    // Ceres' dogleg requires an exact solver.
    trust_region.Describe({"dense_qr",
                           "dense_normal_cholesky",
                           "sparse_normal_cholesky",
                           "dense_schur",
                           "sparse_schur"},
                          set);
  }

  void Apply(
      ceres::Solver::Options* options,
      ceres::GradientProblemSolver::Options* /*gradient_options*/) const {
    trust_region.Apply(options);
    options->trust_region_strategy_type = ceres::DOGLEG;
    CHECK(ceres::StringToDoglegType(dogleg, &options->dogleg_type));
  }
};

// The fields of a line search have the same names in both of Ceres' structs.
template <typename CeresOptions>
void ApplyLineSearch(ceres::LineSearchDirectionType direction,
                     const std::string& line_search,
                     CeresOptions* options) {
  options->line_search_direction_type = direction;
  CHECK(ceres::StringToLineSearchType(line_search, &options->line_search_type));
}

struct BfgsOptions {
  bool use_approximate_eigenvalue_scaling = false;

  void Describe(OptionSet* set) {
    set->Add("use_approximate_eigenvalue_scaling",
             &use_approximate_eigenvalue_scaling,
             "start from a scaled inverse Hessian instead of the identity");
  }

  void Apply(ceres::Solver::Options* options,
             ceres::GradientProblemSolver::Options* gradient_options) const {
    options->minimizer_type = ceres::LINE_SEARCH;
    ApplyTo(ceres::BFGS, options);
    ApplyTo(ceres::BFGS, gradient_options);
  }

  // Quasi-Newton updates need the curvature condition of Wolfe's line search.
  template <typename CeresOptions>
  void ApplyTo(ceres::LineSearchDirectionType direction,
               CeresOptions* options) const {
    ApplyLineSearch(direction, "wolfe", options);
    options->use_approximate_eigenvalue_bfgs_scaling =
        use_approximate_eigenvalue_scaling;
  }
};

struct LbfgsOptions {
  BfgsOptions bfgs;
  int rank = ceres::Solver::Options().max_lbfgs_rank;

  void Describe(OptionSet* set) {
    set->Add("rank", &rank, {1, 1000}, "number of steps that are remembered");
    bfgs.Describe(set);
  }

  void Apply(ceres::Solver::Options* options,
             ceres::GradientProblemSolver::Options* gradient_options) const {
    options->minimizer_type = ceres::LINE_SEARCH;
    bfgs.ApplyTo(ceres::LBFGS, options);
    bfgs.ApplyTo(ceres::LBFGS, gradient_options);
    options->max_lbfgs_rank = rank;
    gradient_options->max_lbfgs_rank = rank;
  }
};

struct NonlinearCgOptions {
  std::string type = "fletcher_reeves";
  std::string line_search = "wolfe";

  void Describe(OptionSet* set) {
    set->Add("type",
             &type,
             {"fletcher_reeves", "polak_ribiere", "hestenes_stiefel"},
             "how the last direction enters the next");
    set->Add(
        "line_search", &line_search, {"wolfe", "armijo"}, "its conditions");
  }

  void Apply(ceres::Solver::Options* options,
             ceres::GradientProblemSolver::Options* gradient_options) const {
    options->minimizer_type = ceres::LINE_SEARCH;
    ApplyTo(options);
    ApplyTo(gradient_options);
  }

  template <typename CeresOptions>
  void ApplyTo(CeresOptions* options) const {
    ApplyLineSearch(ceres::NONLINEAR_CONJUGATE_GRADIENT, line_search, options);
    CHECK(ceres::StringToNonlinearConjugateGradientType(
        type, &options->nonlinear_conjugate_gradient_type));
  }
};

struct SteepestDescentOptions {
  // The curvature condition needs more gradients and has no benefit here.
  std::string line_search = "armijo";

  void Describe(OptionSet* set) {
    set->Add(
        "line_search", &line_search, {"wolfe", "armijo"}, "its conditions");
  }

  void Apply(ceres::Solver::Options* options,
             ceres::GradientProblemSolver::Options* gradient_options) const {
    options->minimizer_type = ceres::LINE_SEARCH;
    ApplyLineSearch(ceres::STEEPEST_DESCENT, line_search, options);
    ApplyLineSearch(ceres::STEEPEST_DESCENT, line_search, gradient_options);
  }
};

template <typename MethodOptions>
CeresMethodRow Row(const std::string& name,
                   bool is_trust_region,
                   const std::string& formula) {
  CeresMethodRow row;
  row.name = name;
  row.formula = formula;
  row.is_trust_region = is_trust_region;
  row.options = [] {
    MethodOptions method;
    OptionSet set;
    method.Describe(&set);
    return set.rows();
  };
  row.configure = [](const Settings& settings,
                     ceres::Solver::Options* options,
                     ceres::GradientProblemSolver::Options* gradient_options,
                     std::string* error) {
    MethodOptions method;
    OptionSet set;
    method.Describe(&set);
    if (!set.SetAll(settings, error)) return false;
    method.Apply(options, gradient_options);
    return true;
  };
  return row;
}

}  // namespace

const std::vector<CeresMethodRow>& CeresMethods() {
  static const auto* const methods = new std::vector<CeresMethodRow>{
      Row<LevenbergMarquardtOptions>(
          "ceres_lm", true, "(J^T J + D^T D / mu) step = -J^T r"),
      Row<DoglegOptions>(
          "ceres_dogleg",
          true,
          "step on the path 0, Cauchy point, -J^+ r, where |D step| <= mu"),
      Row<BfgsOptions>(
          "ceres_bfgs", false, "step = -eta B J^T r, B ~ H^-1 by BFGS updates"),
      Row<LbfgsOptions>("ceres_lbfgs",
                        false,
                        "step = -eta B J^T r, B ~ H^-1 by the last BFGS "
                        "updates"),
      Row<NonlinearCgOptions>("ceres_nonlinear_cg",
                              false,
                              "step_k = eta d_k, d_k = -J^T r + beta d_{k-1}"),
      Row<SteepestDescentOptions>("ceres_steepest_descent",
                                  false,
                                  "step = -eta J^T r, eta by line search"),
  };
  return *methods;
}

const CeresMethodRow* FindCeresMethod(const std::string& name) {
  const std::vector<CeresMethodRow>& methods = CeresMethods();
  const auto it =
      std::find_if(methods.begin(), methods.end(), [&](const auto& row) {
        return row.name == name;
      });
  return it == methods.end() ? nullptr : &*it;
}

}  // namespace invgrad
