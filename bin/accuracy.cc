// Measures how accurate the routes of the half-inverse step are on the
// Jacobians of the problems, at the initial weights and after some training.
//
//   error = |d - d_exact| / |d_exact|
//
// Sample runs:
//
//   accuracy
//   accuracy --problems=quantum_dipole --truncations=1e-5,1e-10
//   accuracy --problems=poisson --truncations=1e-5
//
// d_exact is computed in long double (m = 448 takes some minutes), or by the
// route svd, whose error is about epsilon / truncation. A cell holds the error
// and, in brackets, the route's estimate; docs/results/accuracy.md names the
// columns.

#include <iostream>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "bin/support/lapack_svd.h"
#include "bin/support/learning_run.h"
#include "bin/support/program.h"
#include "bin/support/spectral_reference.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/spectral/spectral_step.h"
#include "report/table.h"

DEFINE_string(problems,
              "oscillator_chain,oscillator_chain:coupling=cubic,quantum_dipole",
              "learning problems, name[:key=value...],...");
DEFINE_string(truncations,
              "1e-2,1e-3,1e-4,1e-5,1e-6,1e-7,1e-8,1e-10",
              "tau: singular values s <= tau s_max are dropped");
DEFINE_int32(train_steps, 1000, "Adam steps before the second measurement");
DEFINE_int32(batch_size, 0, "samples of the batch; 0: as published");
DEFINE_int32(long_double_rows,
             512,
             "largest m for which the reference is long double");

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

double RelativeError(const VectorXd& d, const VectorXd& exact) {
  return (d - exact).norm() / exact.norm();
}

void Measure(const Linearization& at_weights,
             const std::vector<double>& truncations,
             RunCounts* counts) {
  const JacobianOperator& J = *at_weights.jacobian;
  const VectorXd& g = at_weights.loss_gradient;
  MatrixXd dense;
  J.ToDense(&dense);
  std::unique_ptr<const SpectralReference> reference;
  if (J.rows() <= FLAGS_long_double_rows) {
    reference = std::make_unique<SpectralReference>(dense);
    const LongVector& s = reference->s();
    std::cout << fmt::format("s_min / s_max = {:.1e}\n\n",
                             static_cast<double>(s[s.size() - 1] / s[0]));
  }
  LapackSvd<float> single;
  const bool converged = single.Compute(dense.cast<float>());
  counts->Add(converged);
  Table table({{"tau"},
               {"rank"},
               {"route", Table::Align::kLeft},
               {"auto"},
               {"gram"},
               {"svd"},
               {"sgesdd"}});
  for (const double tau : truncations) {
    const SpectralFilter filter = SpectralFilter::HalfInverse(tau);
    SpectralStepSummary summary;
    VectorXd exact;
    if (reference != nullptr) {
      exact = reference->Step(filter, g).cast<double>();
    } else {
      SpectralStepOptions by_svd;
      by_svd.route = SpectralRoute::kSvd;
      if (!SpectralStep(J, g, filter, by_svd, &exact, &summary)) {
        Warn(summary.message);
        counts->Add(false);
        continue;
      }
    }
    // The error of a route, with its estimate in brackets.
    const auto cell = [&](SpectralRoute route) -> std::string {
      constexpr double kInfinity = std::numeric_limits<double>::infinity();
      SpectralStepOptions options = SpectralStepOptions::ForTraining();
      options.route = route;
      if (route != SpectralRoute::kAuto) {
        options.tolerance = options.threshold_tolerance = kInfinity;
      }
      VectorXd d;
      const bool is_done = SpectralStep(J, g, filter, options, &d, &summary);
      counts->Add(is_done);
      if (!is_done) return "refused";
      std::string text = fmt::format(
          "{:.1e} ({:.0e})", RelativeError(d, exact), summary.estimated_error);
      if (summary.num_undecided > 0) {
        text += fmt::format(", {} undecided", summary.num_undecided);
      }
      return text;
    };
    const std::string by_auto = cell(SpectralRoute::kAuto);
    const std::string route = SpectralRouteName(summary.route);
    const std::string rank = std::to_string(summary.rank);
    const VectorXd by_single = FilteredStep(single, filter, g);
    table.AddRow(
        {fmt::format("{:.0e}", tau),
         rank,
         route,
         by_auto,
         cell(SpectralRoute::kGram),
         reference != nullptr ? cell(SpectralRoute::kSvd) : "reference",
         converged ? fmt::format("{:.1e}", RelativeError(by_single, exact))
                   : "nan"});
  }
  std::cout << table.ToMarkdown() << "\n" << std::flush;
}

bool Run(RunCounts* counts, std::string* error) {
  std::vector<Specification> problems;
  std::vector<double> truncations;
  if (!ParseFlag("problems", ParseSpecifications, &problems, error) ||
      !ParseFlag("truncations", ParseNumbers, &truncations, error) ||
      !CheckFlags({{"train_steps", {0.0}}, {"batch_size", {0.0}}}, error)) {
    return false;
  }
  for (const double tau : truncations) {
    if (tau < 1.0) continue;
    *error = "--truncations: must be below 1";
    return false;
  }
  for (const Specification& specification : problems) {
    LearningProblem problem;
    if (!NameFlag("problems",
                  CreateLearningProblem(specification.text, &problem, error),
                  error)) {
      return false;
    }
    const std::set<int> train_steps = {0, FLAGS_train_steps};
    for (const int num_steps : train_steps) {
      Linearization at_weights;
      if (!LinearizeAfterTraining(
              problem, FLAGS_batch_size, num_steps, &at_weights, error)) {
        *error = specification.text + ": " + *error;
        return false;
      }
      std::cout << fmt::format(
                       "**{}**, {}: J {} x {}\n",
                       specification.text,
                       num_steps == 0
                           ? "initial weights"
                           : fmt::format("after {} steps of Adam", num_steps),
                       at_weights.jacobian->rows(),
                       at_weights.jacobian->cols())
                << std::flush;
      Measure(at_weights, truncations, counts);
    }
  }
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(argc,
                             argv,
                             "measures the errors of the half-inverse step's "
                             "routes on the Jacobians of the problems",
                             invgrad::Run);
}
